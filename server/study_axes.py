"""The axes of a study: every axis of a variant, and what else its requests may differ in."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from renderer.build.tree import SahCosts
from renderer.request import parse_size
from renderer.variant import AXES, expand

Words = str | Sequence[str]
"""A list as a text (of SAH costs: `3.0,1.5; 1.5,3.0`, of all else a comma list), or values."""
SWITCH = {"on": True, "off": False}


class StudyError(ValueError):
    """A study that cannot be run; the message is one sentence that says what to do."""


def read_costs(text: str) -> SahCosts:
    """Read `CT,CI`."""
    try:
        traversal, intersection = (float(part) for part in text.split(","))
    except ValueError:
        raise StudyError(f"The SAH costs {text!r} are not understood: write them as 3.0,1.5.") from None
    return SahCosts(traversal, intersection)


def read_switch(name: str, text: str) -> bool:
    """Read `on` or `off`."""
    if text not in SWITCH:
        raise StudyError(f"Unknown {name} {text!r}: choose one of on, off.")
    return SWITCH[text]


def write_costs(costs: SahCosts) -> str:
    """The costs as `read_costs` reads them."""
    return f"{costs.traversal},{costs.intersection}"


SETTINGS: dict[str, Callable[[str], Any]] = {
    "sah": read_costs,
    "size": parse_size,
    "specialise": lambda text: read_switch("specialise", text),
}
"""The axes that are no variant's, each with the reading of one of its values."""
STUDY_AXES = (*AXES, *SETTINGS)


def split_words(axis: str, words: Words) -> list[str]:
    """The values in a list of an axis, each once."""
    if isinstance(words, str):
        words = re.split(r"[;\s]+" if axis == "sah" else ",", words.strip())
    return list(dict.fromkeys(str(word).strip() for word in words))


def read_axes(axes: Mapping[str, Words]) -> tuple[dict[str, tuple[str, ...]], dict[str, tuple[Any, ...]]]:
    """The values of each axis: those of variants, and those of SETTINGS as their readings.

    Raise StudyError, RequestError or VariantError for an axis without a value, or one that does not exist.
    """
    unknown = [axis for axis in axes if axis not in STUDY_AXES]
    if unknown:
        raise StudyError(f"Unknown axis {unknown[0]!r}: choose one of {', '.join(STUDY_AXES)}.")
    listed = {axis: split_words(axis, words) for axis, words in axes.items()}
    empty = [axis for axis, words in listed.items() if not words]
    if empty:
        raise StudyError(f"The axis {empty[0]} has no value: give at least one.")
    variants = {axis: expand(axis, ",".join(words)) for axis, words in listed.items() if axis in AXES}
    settings = {
        axis: tuple(dict.fromkeys(SETTINGS[axis](word) for word in words))
        for axis, words in listed.items()
        if axis in SETTINGS
    }
    return variants, settings
