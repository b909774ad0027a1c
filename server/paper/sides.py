"""Two sides of a comparison over cells, and what an interval of their ratio says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from renderer.times.difference import Difference
from server.paper.data import Cell, Change, Section
from server.paper.series import MIN_ROUNDS, Series, cell_difference, collect
from server.paper.verdict import Outcome

BAND = 1.1
"""Within 10 % of 1, either way, is about equal."""

Scenes = Literal["all", "few", "complex"]


@dataclass(frozen=True, eq=False)
class Sides:
    """Both sides' series, cell by cell, and each cell's own difference: the first's frame time by the second's."""

    first: list[Series]
    second: list[Series]
    parts: list[tuple[Cell, Difference]]
    missing: tuple[str, ...]


def chosen_scenes(section: Section, scenes: Scenes) -> list[str]:
    """The names of the scenes that a claim is about."""
    return {"all": list(section.scenes), "few": section.few(), "complex": section.complex()}[scenes]


def sides_of(section: Section, places: Sequence[Cell], first: Change, second: Change) -> Sides:
    """Compare every place under two changes; one that lacks a side is listed as missing."""
    kept, missing = [], []
    for place in places:
        found = cell_difference(section, place.changed(second), place.changed(first))
        if isinstance(found, str):
            missing.append(found)
        else:
            kept.append((place, found))
    series = collect(section, [place.changed(change) for place, _ in kept for change in (first, second)]).series
    return Sides(
        [series[place.changed(first)] for place, _ in kept],
        [series[place.changed(second)] for place, _ in kept],
        kept,
        tuple(dict.fromkeys(missing)),
    )


def below_one(found: Difference) -> Outcome:
    """Whether the ratio's interval lies below 1, above it, or around it."""
    if found.low is None or found.high is None or found.low <= 1 <= found.high:
        return "undecided"
    return "holds" if found.high < 1 else "does not hold"


def above_one(found: Difference) -> Outcome:
    """Whether the ratio's interval lies above 1, below it, or around it."""
    opposite: dict[Outcome, Outcome] = {"holds": "does not hold", "does not hold": "holds", "undecided": "undecided"}
    return opposite[below_one(found)]


def within_band(found: Difference) -> Outcome:
    """Whether the ratio's interval lies within BAND, outside it, or across its edge."""
    if found.low is None or found.high is None:
        return "undecided"
    if found.low >= 1 / BAND and found.high <= BAND:
        return "holds"
    return "does not hold" if found.low > BAND or found.high < 1 / BAND else "undecided"


def too_few(found: Difference) -> str:
    """Why there is no interval, or nothing."""
    if found.low is not None:
        return ""
    return f" There are {min(found.rounds)} rounds a side; an interval needs {MIN_ROUNDS}."
