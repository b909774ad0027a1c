"""Claims that one of several is the best, or the worst."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from renderer.times.difference import Difference
from server.paper.data import Cell, Change, Section
from server.paper.multiple import LEVEL, larger
from server.paper.series import Series, bases, cell_difference, collect, pooled
from server.paper.sides import Scenes, above_one, below_one, chosen_scenes, too_few
from server.paper.verdict import Finding, Outcome, Part, undecided
from server.paper.words import counted, interval_text, joined

Named = Mapping[str, Change]
Groups = Callable[[Section], tuple[Named, Named] | str]
Means = dict[str, Series]


@dataclass(frozen=True)
class Best:
    """One of a group takes less time a frame than all the others, on the geometric mean over cells.

    `groups` gives the group and the others by their names, or one sentence why there are none. `worst` turns the
    claim round: one of the group takes more time than all the others.
    """

    groups: Groups
    each: bool = False
    scenes: Scenes = "all"
    worst: bool = False

    def judge(self, section: Section) -> Finding:
        """Holds where one of the group is faster than every other; does not where an other is faster than the group.

        One alone is faster than each other where each interval says so. Wherever there is a choice (of the group's,
        or of the other that refutes the claim), p values are adjusted for all comparisons.
        """
        groups = self.groups(section)
        if isinstance(groups, str):
            return undecided(groups)
        group, others = groups
        means, places, missing = self._means(section, group, others)
        if not places:
            return undecided("No scene has a result of every side.", missing)
        found = {(a, b): pooled([means[b]], [means[a]]) for a in group for b in others}
        outcome = self._outcome(list(group), list(others), means, found)
        return self._finding(outcome, list(group), list(others), means, found, places, missing)

    def _means(self, section: Section, group: Named, others: Named) -> tuple[Means, int, tuple[str, ...]]:
        """Every name's mean over the places that have them all, how many these are, and what is missing elsewhere."""
        named = {**group, **others}
        places = bases(section, named.values(), chosen_scenes(section, self.scenes), each=self.each)
        lacking = {place: _lacking(section, place, group, others) for place in places}
        whole = [place for place, reasons in lacking.items() if not reasons]
        series = collect(section, [place.changed(change) for place in whole for change in named.values()]).series
        means: Means = {
            name: np.mean([series[place.changed(change)] for place in whole], axis=0)
            for name, change in named.items()
            if whole
        }
        return means, len(whole), tuple(dict.fromkeys(reason for reasons in lacking.values() for reason in reasons))

    def _outcome(
        self, group: list[str], others: list[str], means: Means, found: Mapping[tuple[str, str], Difference]
    ) -> Outcome:
        if any(each.low is None for each in found.values()):
            return "undecided"
        pairs = list(found)
        sign = -1 if self.worst else 1
        ahead = dict(zip(pairs, larger([(sign * means[b], sign * means[a]) for a, b in pairs]), strict=True))
        behind = dict(zip(pairs, larger([(sign * means[a], sign * means[b]) for a, b in pairs]), strict=True))
        says = above_one if self.worst else below_one
        if len(group) == 1 and all(says(found[group[0], b]) == "holds" for b in others):
            return "holds"
        if any(all(ahead[a, b] <= LEVEL for b in others) for a in group):
            return "holds"
        return "does not hold" if any(all(behind[a, b] <= LEVEL for a in group) for b in others) else "undecided"

    def _finding(
        self,
        outcome: Outcome,
        group: list[str],
        others: list[str],
        means: Means,
        found: Mapping[tuple[str, str], Difference],
        places: int,
        missing: tuple[str, ...],
    ) -> Finding:
        first = max if self.worst else min

        def time(name: str) -> float:
            return float(np.median(means[name]))

        ours, rival = first(group, key=time), first(others, key=time)
        main = found[ours, rival]
        what = f"Frame time, {ours} by {rival}"
        word = "slowest" if self.worst else "fastest"
        over = f"the geometric mean over {counted(places, 'cell' if self.each else 'scene')}"
        figures = interval_text(main.ratio, main.low, main.high)
        reason = f"{what}, the {word} of {joined(others)}: {figures}, {over}.{too_few(main)}"
        says = above_one if self.worst else below_one
        parts = tuple(Part(f"{a} by {b}", d.ratio, d.low, d.high, says(d)) for (a, b), d in found.items())
        return Finding(outcome, reason, what, main.ratio, main.low, main.high, parts=parts, missing=missing)


def _lacking(section: Section, place: Cell, group: Named, others: Named) -> list[str]:
    """Why the sides cannot be compared at a place."""
    found = [
        cell_difference(section, place.changed(other), place.changed(mine))
        for mine in group.values()
        for other in others.values()
    ]
    return [reason for reason in found if isinstance(reason, str)]


def fixed(group: Named, others: Named) -> Groups:
    """Groups that do not depend on the section."""
    return lambda section: (group, others)
