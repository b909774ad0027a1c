"""Claims that one figure predicts speed: its rank correlation with the frame time, within each scene over variants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from server.paper.data import Cell, Section
from server.paper.measures import Measure, choose, value_of
from server.paper.ranks import Group, correlations, ends, resampled
from server.paper.series import MIN_ROUNDS, collect
from server.paper.verdict import Finding, Outcome, Part, undecided
from server.paper.words import counted, lower_first, range_text, ratio_text

PREDICTS = 0.5
"""A predictor's correlation must be above this: at 0.5 it orders about two of three pairs right."""
MIN_VARIANTS, MIN_SAH, MIN_GROUPS = 5, 3, 4

Measures = tuple[Measure, ...]


@dataclass(frozen=True)
class Predicts:
    """More of a measure means more time a frame; of several rivals, it says so better than each of them.

    Within a scene all variants of method fragment are ranked, without the traversal `without`. With `by_costs` those of
    one scene and traversal are, which differ in SAH costs alone, and whole groups are resampled in place of variants.
    """

    measures: Measures
    rivals: tuple[Measures, ...] = ()
    without: str = ""
    by_costs: bool = False

    def judge(self, section: Section) -> Finding:
        """Without rivals the mean correlation must be above PREDICTS; with rivals, above the strongest of theirs."""
        chosen = [choose(section, _cells(section), each) for each in (self.measures, *self.rivals)]
        groups, missing = self._groups(section, chosen)
        fewest = MIN_GROUPS if self.by_costs else 1
        if len(groups) < fewest:
            needed = f"{MIN_SAH} SAH costs in {MIN_GROUPS}" if self.by_costs else f"{MIN_VARIANTS} variants in 1"
            return undecided(f"Too little was measured: {needed} groups with figures are needed.", missing)
        if min(group.times.shape[1] for group in groups) < MIN_ROUNDS:
            return undecided(f"An interval needs {MIN_ROUNDS} rounds.", missing)
        return self._finding(groups, chosen, missing)

    def _groups(self, section: Section, measures: Sequence[Measure]) -> tuple[list[Group], tuple[str, ...]]:
        found = collect(section, _cells(section))
        named: dict[str, list[Cell]] = {}
        for cell in found.series:
            if cell.traversal != self.without and (not self.by_costs or cell.layout == "normal"):
                named.setdefault(f"{cell.traversal} on {cell.scene}" if self.by_costs else cell.scene, []).append(cell)
        groups = []
        lacking = list(found.missing)
        for name, cells in named.items():
            rows = [(cell, [value_of(section, cell, measure) for measure in measures]) for cell in cells]
            whole = [(cell, [v for v in values if v is not None]) for cell, values in rows if None not in values]
            lacking += [f"{cell.text}: no {lower_first(measures[0].name)}" for cell, values in rows if None in values]
            if len(whole) >= (MIN_SAH if self.by_costs else MIN_VARIANTS):
                columns = np.array([values for _, values in whole]).T
                times = np.stack([found.series[cell] for cell, _ in whole])
                groups.append(Group(name, tuple(columns), times))
        return groups, tuple(dict.fromkeys(lacking))

    def _finding(self, groups: list[Group], measures: Sequence[Measure], missing: tuple[str, ...]) -> Finding:
        each = np.array([correlations(group) for group in groups])
        if np.isnan(each).all(axis=0).any():
            return undecided("The figure is the same for all variants.", missing)
        draws, means = resampled(groups, whole=self.by_costs), np.nanmean(each, axis=0)
        value, drawn, line = float(means[0]), draws[0], PREDICTS
        what = f"Rank correlation of {lower_first(measures[0].name)} with frame time"
        if self.rivals:
            value, drawn, line = value - float(means[1:].max()), draws[0] - draws[1:].max(axis=0), 0.0
            names = ", ".join(
                f"{lower_first(m.name)} {ratio_text(mean)}" for m, mean in zip(measures, means, strict=True)
            )
            what = f"Rank correlation of {lower_first(measures[0].name)} less the largest of the others' ({names})"
        interval = ends(drawn)
        if interval is None:
            return undecided("The figure is the same for all variants.", missing)
        low, high = interval
        outcome: Outcome = "holds" if low > line else "does not hold" if high < line else "undecided"
        over = f"mean over {counted(len(groups), 'group' if self.by_costs else 'scene')}, against {line:g}"
        reason = f"{what}: {ratio_text(value)} ({range_text(low, high)}), {over}."
        parts = tuple(
            Part(group.name, None if np.isnan(row[0]) else float(row[0]), note=counted(len(group.times), "variant"))
            for group, row in zip(groups, each, strict=True)
        )
        basis = measures[0].basis
        return Finding(outcome, reason, what, value, low, high, basis=basis, parts=parts, missing=missing)


def _cells(section: Section) -> list[Cell]:
    return [cell for cell in section.documents if cell.method == "fragment"]
