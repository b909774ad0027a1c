"""Claims about every cell: everywhere, and not always."""

from __future__ import annotations

import math
from dataclasses import dataclass

from renderer.times.difference import Difference
from server.paper.data import Change, Section
from server.paper.multiple import LEVEL, larger
from server.paper.series import bases
from server.paper.sides import BAND, sides_of, too_few
from server.paper.verdict import Finding, Outcome, Part, undecided
from server.paper.words import counted, interval_text

_CELL: dict[tuple[bool, bool], Outcome] = {(True, False): "holds", (False, True): "does not hold"}


@dataclass(frozen=True)
class Everywhere:
    """In every cell `first` is similar to each of `rivals` or faster: its frame time is at most `most` of theirs.

    `denied` turns the claim round: in some cell it takes more.
    """

    first: Change
    rivals: tuple[tuple[str, Change], ...]
    what: str
    most: float = BAND
    denied: bool = False

    def judge(self, section: Section) -> Finding:
        """Every cell's interval must end below `most`; one cell above it refutes that, its p adjusted for all cells."""
        changes = (self.first, *(change for _, change in self.rivals))
        places = bases(section, changes, section.scenes, each=True)
        compared = [(name, sides_of(section, places, self.first, change)) for name, change in self.rivals]
        cells = [(f"{name}: {cell.text}", found) for name, sides in compared for cell, found in sides.parts]
        missing = tuple(dict.fromkeys(line for _, sides in compared for line in sides.missing))
        if not cells:
            return undecided("Nothing was measured on both sides.", missing)
        pairs = [pair for _, sides in compared for pair in zip(sides.first, sides.second, strict=True)]
        rounds = min(len(side) for pair in pairs for side in pair)
        over = larger([(first[:rounds] - math.log(self.most), second[:rounds]) for first, second in pairs])
        return self._finding(cells, over, missing)

    def _finding(self, cells: list[tuple[str, Difference]], over: list[float], missing: tuple[str, ...]) -> Finding:
        below = [found.high is not None and found.high < self.most for _, found in cells]
        above = [found.low is not None and p <= LEVEL for (_, found), p in zip(cells, over, strict=True)]
        worst, main = max(cells, key=lambda cell: cell[1].ratio)
        parts = tuple(
            Part(name, d.ratio, d.low, d.high, self._turned(_CELL.get((low, high), "undecided")), f"p {p:.3f}")
            for (name, d), low, high, p in zip(cells, below, above, over, strict=True)
        )
        outcome: Outcome = "undecided"
        if any(above):
            outcome = self._turned("does not hold")
        elif all(below) and not missing:
            outcome = self._turned("holds")
        reason = (
            f"{self.what}: {interval_text(main.ratio, main.low, main.high)}, {worst}. Below {self.most:g} in "
            f"{sum(below)} of {counted(len(cells), 'comparison')}, above it (adjusted for all) in {sum(above)}."
            f"{too_few(main)}"
        )
        return Finding(outcome, reason, self.what, main.ratio, main.low, main.high, parts=parts, missing=missing)

    def _turned(self, outcome: Outcome) -> Outcome:
        turned: dict[Outcome, Outcome] = {"holds": "does not hold", "does not hold": "holds", "undecided": "undecided"}
        return turned[outcome] if self.denied else outcome
