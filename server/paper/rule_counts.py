"""Claims about counts and models: they are exact for a scene, so what is uncertain is which scenes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean

from server.paper.data import TRAVERSALS, Cell, Change, Section
from server.paper.measures import Measure, choose, value_of
from server.paper.rule_best import Groups, Named
from server.paper.series import bases
from server.paper.verdict import Finding, Outcome, Part, undecided
from server.paper.words import counted, interval_text, joined, lower_first

SAME = 1e-3
"""Figures that differ by less than this fraction are the same."""
MIN_SCENES = 2
"""One scene alone says nothing about scenes."""
SPREAD = "least and most over scenes"
"""What stands in place of an interval."""


@dataclass(frozen=True)
class Counts:
    """In every scene each of a group has more (or with `less`, less) of a measure than each of the others.

    Of several measures the section's best one is taken (`server.paper.measures.choose`). A scene's figure is the
    geometric mean over traversals where `each` is set.
    """

    measures: tuple[Measure, ...]
    groups: Groups
    less: bool = False
    each: bool = False

    def judge(self, section: Section) -> Finding:
        """Holds where all scenes agree, does not where none does, else undecided."""
        groups = self.groups(section)
        if isinstance(groups, str):
            return undecided(groups)
        group, others = groups
        named = {**group, **others}
        places = bases(section, named.values(), section.scenes, each=self.each)
        measure = choose(section, [p.changed(c) for p in places for c in named.values()], self.measures)
        parts, missing = [], []
        for scene in dict.fromkeys(place.scene for place in places):
            here = [place for place in places if place.scene == scene]
            values, lacking = _values(section, here, named, measure)
            missing += lacking
            if values:
                parts.append(self._part(scene, values, group, others))
        return _over_scenes(parts, measure, f"{measure.name}, {joined(list(group))} by {joined(list(others))}", missing)

    def _part(self, scene: str, values: Mapping[str, float], group: Named, others: Named) -> Part:
        """The claim's weakest comparison in a scene."""
        near, far = (max, min) if self.less else (min, max)
        ours, rival = near(group, key=values.__getitem__), far(others, key=values.__getitem__)
        return _compared(scene, values[ours] / values[rival], f"{ours} by {rival}", less=self.less)


@dataclass(frozen=True)
class MoreOnComplex:
    """Every complex scene has more of a measure than every small one, on the geometric mean over traversals."""

    measures: tuple[Measure, ...]

    def judge(self, section: Section) -> Finding:
        """Holds where all complex scenes have more, does not where none has, else undecided."""
        named: Named = {name: {"traversal": name} for name in TRAVERSALS}
        places = [Cell(scene) for scene in section.scenes]
        measure = choose(section, [p.changed(c) for p in places for c in named.values()], self.measures)
        figures, missing = {}, []
        for place in places:
            values, lacking = _values(section, [place], named, measure)
            missing += lacking
            if values:
                figures[place.scene] = math.exp(fmean(math.log(value) for value in values.values()))
        few = [(figures[scene], scene) for scene in section.few() if scene in figures]
        if not few:
            return undecided("It takes a scene with few primitives and complex ones.", tuple(missing))
        most, small = max(few)
        parts = [
            _compared(scene, figures[scene] / most, f"{scene} by {small}", less=False)
            for scene in section.complex()
            if scene in figures
        ]
        return _over_scenes(parts, measure, f"{measure.name}, each complex scene by {small}", missing)


def _values(
    section: Section, places: list[Cell], named: Mapping[str, Change], measure: Measure
) -> tuple[dict[str, float], list[str]]:
    """Each name's geometric mean over the places that have them all, and the cells that have nothing."""
    rows, missing = [], []
    for place in places:
        row = {name: value_of(section, place.changed(change), measure) for name, change in named.items()}
        lacking = [place.changed(named[name]).text for name, value in row.items() if value is None]
        missing += [f"{cell}: no {lower_first(measure.name)}" for cell in lacking]
        if not lacking:
            rows.append({name: math.log(value) for name, value in row.items() if value is not None})
    return {name: math.exp(fmean(row[name] for row in rows)) for name in named if rows}, missing


def _compared(scene: str, ratio: float, note: str, *, less: bool) -> Part:
    signed = -math.log(ratio) if less else math.log(ratio)
    outcome: Outcome = "holds" if signed > SAME else "does not hold"
    return Part(scene, ratio, outcome=outcome, note=f"{note}, the same" if abs(signed) <= SAME else note)


def _over_scenes(parts: list[Part], measure: Measure, what: str, missing: list[str]) -> Finding:
    lacking = tuple(dict.fromkeys(missing))
    if len(parts) < MIN_SCENES:
        seen = f"{counted(len(parts), 'scene')} with figures of {lower_first(measure.name)}: {MIN_SCENES} are needed."
        return undecided(seen, lacking)
    ratios = [part.value for part in parts if part.value is not None]
    agreeing = sum(part.outcome == "holds" for part in parts)
    outcome: Outcome = "undecided"
    if agreeing in (0, len(parts)):
        outcome = "holds" if agreeing else "does not hold"
    blind = measure.basis == "model" and all(abs(math.log(ratio)) <= SAME for ratio in ratios)
    mean = math.exp(fmean(math.log(ratio) for ratio in ratios))
    note = " The model tells no difference." if blind else ""
    reason = (
        f"{what}: {interval_text(mean, min(ratios), max(ratios))}, geometric mean, least and most over "
        f"{counted(len(parts), 'scene')}; {agreeing} agree.{note}"
    )
    return Finding(
        "undecided" if blind else outcome, reason, what, mean, min(ratios), max(ratios), SPREAD, measure.basis,
        tuple(parts), lacking,
    )  # fmt: skip
