"""Dimensions that are made of several of a set-up's facts: its SAH costs and whether it is specialised."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SAH = "sah"
SPECIALISE = "specialise"
DERIVED = (SAH, SPECIALISE)


class DerivedError(ValueError):
    """A value that does not exist; the message is one sentence that says what to do."""


def derived_texts(facts: Mapping[str, Any]) -> tuple[str, ...]:
    """The values of DERIVED in a set-up's facts or a flat row."""
    return (
        sah_text(facts.get("sah_traversal"), facts.get("sah_intersection")),
        specialise_text(facts.get("specialised")),
    )


def sah_text(traversal: Any, intersection: Any) -> str:
    """SAH costs as `3.0,1.5`, however their numbers are written; `None,None` where there are none."""
    return ",".join(str(cost if cost is None else float(cost)) for cost in (traversal, intersection))


def specialise_text(specialised: Any) -> str:
    """`on` where a plan was made for its scene (what it left out is listed), else `off`."""
    return "off" if specialised is None else "on"


def read_derived(name: str, text: str) -> str:
    """A value as it stands in a table; raise DerivedError."""
    if name == SPECIALISE:
        if text not in ("on", "off"):
            raise DerivedError(f"Unknown specialise {text!r}: choose one of on, off.")
        return text
    try:
        return sah_text(*(None if part == "None" else float(part) for part in text.split(",")))
    except (TypeError, ValueError) as error:
        raise DerivedError(f"The SAH costs {text!r} are not understood: write them as 3.0,1.5.") from error
