"""Claims about frame times on the mean over cells: faster, about equal, and how a ratio differs between scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.times.difference import Difference
from server.paper.data import Cell, Change, Section
from server.paper.series import Series, bases, cell_difference, collect, pooled
from server.paper.sides import Scenes, above_one, below_one, chosen_scenes, sides_of, too_few
from server.paper.verdict import Finding, Outcome, Part, undecided
from server.paper.words import counted, interval_text

Says = Callable[[Difference], Outcome]


@dataclass(frozen=True)
class Ratio:
    """The frame time of `first` by that of `second` on the geometric mean over cells; `says` reads its interval."""

    first: Change
    second: Change
    what: str
    says: Says = below_one
    each: bool = True
    scenes: Scenes = "all"

    def judge(self, section: Section) -> Finding:
        """The interval over rounds of the mean over cells decides; every cell's own is listed."""
        places = bases(section, (self.first, self.second), chosen_scenes(section, self.scenes), each=self.each)
        sides = sides_of(section, places, self.first, self.second)
        if not sides.parts:
            return undecided("Nothing was measured on both sides.", sides.missing)
        pool = pooled(sides.second, sides.first)
        parts = [Part(cell.text, each.ratio, each.low, each.high, self.says(each)) for cell, each in sides.parts]
        over = f"the geometric mean over {counted(len(parts), 'cell')}"
        return _finding(self.says(pool), pool, self.what, over, parts, sides.missing)


@dataclass(frozen=True)
class Shift:
    """The ratio of `first`'s frame time to the rivals' geometric mean, on complex scenes by that on small ones."""

    first: Change
    rivals: tuple[Change, ...]
    what: str
    says: Says = above_one
    each: bool = True

    def judge(self, section: Section) -> Finding:
        """The interval over rounds of the ratio of the two ratios decides."""
        ratios, missing = self._ratios(section)
        few = [ratio for scene, ratio in ratios.items() if scene in section.few()]
        many = [ratio for scene, ratio in ratios.items() if scene in section.complex()]
        if not few or not many:
            return undecided("It takes a scene with few primitives and a complex one.", missing)
        pool = pooled(few, many)
        parts = [Part(scene, float(np.exp(np.median(ratio)))) for scene, ratio in ratios.items()]
        over = f"{counted(len(many), 'complex scene')} against {counted(len(few), 'small one')}"
        return _finding(self.says(pool), pool, self.what, over, parts, missing)

    def _ratios(self, section: Section) -> tuple[dict[str, Series], tuple[str, ...]]:
        """The logarithm of each round's ratio in every scene that has all of its cells."""
        changes = (self.first, *self.rivals)
        places = {scene: bases(section, changes, [scene], each=self.each) for scene in section.scenes}
        lacking = {scene: self._lacking(section, each) for scene, each in places.items()}
        whole = {scene: each for scene, each in places.items() if each and not lacking[scene]}
        found = collect(
            section, [place.changed(change) for each in whole.values() for place in each for change in changes]
        )
        ratios = {
            scene: _mean(found.series, each, (self.first,)) - _mean(found.series, each, self.rivals)
            for scene, each in whole.items()
        }
        return ratios, tuple(dict.fromkeys(reason for reasons in lacking.values() for reason in reasons))

    def _lacking(self, section: Section, places: Iterable[Cell]) -> list[str]:
        found = [
            cell_difference(section, place.changed(rival), place.changed(self.first))
            for place in places
            for rival in self.rivals
        ]
        return [reason for reason in found if isinstance(reason, str)]


def _mean(series: Mapping[Cell, Series], places: Iterable[Cell], changes: Sequence[Change]) -> Series:
    found: Series = np.mean([series[place.changed(change)] for place in places for change in changes], axis=0)
    return found


def _finding(
    outcome: Outcome, pool: Difference, what: str, over: str, parts: list[Part], missing: tuple[str, ...]
) -> Finding:
    reason = f"{what}: {interval_text(pool.ratio, pool.low, pool.high)}, {over}.{too_few(pool)}"
    return Finding(outcome, reason, what, pool.ratio, pool.low, pool.high, parts=tuple(parts), missing=missing)
