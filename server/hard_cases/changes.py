"""Two studies of hard cases held against each other, cell by cell."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from typing import Any

from renderer.variant import Variant
from server.hard_cases.words import count_name, counts_of, write_ulps

Json = dict[str, Any]
Place = tuple[str, tuple[tuple[str, str], ...]]
ENVIRONMENT = ("seed", "share", "device", "versions")


@dataclass(frozen=True)
class Change:
    """A cell that answers otherwise; `worse` and `better` by the promises that it breaks."""

    label: str
    family: str
    what: list[str]
    verdict: str


@dataclass(frozen=True)
class Changes:
    """What differs from a baseline: cells, those of one run alone by family, and the environment.

    `cost_ratio` is the median over the cells of what a ray costs in ordinary rays, by the baseline's; None without any.
    """

    cells: list[Change]
    same: int
    only_baseline: list[str]
    only_against: list[str]
    environment: list[tuple[str, str, str]]
    cost_ratio: float | None


def find_changes(baseline: Json, against: Json) -> Changes:
    """Hold a study's document against a baseline's."""
    first, second = _by_place(baseline["cells"]), _by_place(against["cells"])
    shared = [place for place in first if place in second]
    found = [change for place in shared if (change := _change(first[place], second[place]))]
    ratios = [
        second[place]["cost"] / first[place]["cost"]
        for place in shared
        if first[place]["cost"] and second[place]["cost"] is not None
    ]
    order = {"worse": 0, "better": 1, "other": 2}
    return Changes(
        sorted(found, key=lambda change: order[change.verdict]),
        len(shared) - len(found),
        _alone(first, second),
        _alone(second, first),
        _environment(baseline, against),
        median(ratios) if ratios else None,
    )


def _by_place(cells: Iterable[Json]) -> dict[Place, Json]:
    """Cells by family and variant; an axis that is younger than a document had its default there."""
    usual = Variant().as_dict()
    return {(cell["family"], tuple(sorted((usual | cell["variant"]).items()))): cell for cell in cells}


def _change(first: Json, second: Json) -> Change | None:
    what = []
    if first["outcome"] != second["outcome"]:
        what.append(f"{first['outcome']} → {second['outcome']}")
    for name in dict.fromkeys((*counts_of(first), *counts_of(second))):
        if first.get(name) != second.get(name):
            what.append(f"{count_name(name)} {_told(first.get(name))} → {_told(second.get(name))}")
    ulps = first["t_ulp_max"], second["t_ulp_max"]
    if ulps[0] != ulps[1]:
        what.append(f"worst t {' → '.join('none' if value is None else write_ulps(value) for value in ulps)}")
    if not what:
        return None
    broken = len(first["broken"]), len(second["broken"])
    verdict = "worse" if broken[0] < broken[1] else "better" if broken[0] > broken[1] else "other"
    return Change(second["label"], second["family"], what, verdict)


def _told(count: int | None) -> str:
    return "none" if count is None else f"{count:,}"


def _alone(mine: dict[Place, Json], other: dict[Place, Json]) -> list[str]:
    return list(
        dict.fromkeys(f"{cell['label']} on {cell['family']}" for place, cell in mine.items() if place not in other)
    )


def _environment(baseline: Json, against: Json) -> list[tuple[str, str, str]]:
    first, second = _facts(baseline), _facts(against)
    names = dict.fromkeys((*first, *second))
    pairs = [(name, first.get(name, "not told"), second.get(name, "not told")) for name in names]
    return [pair for pair in pairs if pair[1] != pair[2]]


def _facts(document: Json) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in ENVIRONMENT:
        value = document[name]
        parts = {f"{name} {key}": item for key, item in value.items()} if isinstance(value, dict) else {name: value}
        found |= {key: str(item) for key, item in parts.items() if item is not None}
    return found
