"""An option for each axis of a variant, made from the table, so that a new axis needs no line in a verb."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any

import typer

from renderer.variant import AXES

ANY = "A value, a comma list, paper or all,"


def with_axes(verb: Callable[..., None], usual: Mapping[str, str | None]) -> Callable[..., None]:
    """The verb, whose parameter `axes` (a dictionary) becomes an option for each axis, `usual` being its default.

    An axis without a default is None where it is not given.
    """

    def run(**given: Any) -> None:
        axes = {axis: given.pop(axis) for axis in AXES}
        verb(**given, axes=axes)

    own = [one for one in inspect.signature(verb, eval_str=True).parameters.values() if one.name != "axes"]
    words = [
        inspect.Parameter(
            axis,
            inspect.Parameter.KEYWORD_ONLY,
            default=usual[axis],
            annotation=Annotated[str | None, typer.Option(help=f"{ANY} of {', '.join(AXES[axis])}.", metavar="WORDS")],
        )
        for axis in AXES
    ]
    head, tail = own[:1], own[1:]
    parameters = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in (*head, *words, *tail)]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    run.__name__, run.__doc__ = verb.__name__, verb.__doc__
    return run
