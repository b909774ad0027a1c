"""Frame times of cells as one figure a round, and the sides of a comparison over several cells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.times.difference import Difference, by_round, difference
from renderer.times.interval import median
from server.comparison.differences import pair_of
from server.paper.data import TRAVERSALS, Cell, Change, Json, Section

Series = npt.NDArray[np.float64]
"""The logarithm of each round's frame time, in ms."""

MIN_ROUNDS = 4
"""The exact interval needs so many rounds a side."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The series of cells, all of as many rounds; `missing` says what is not there and why."""

    series: Mapping[Cell, Series]
    missing: tuple[str, ...]


def bases(section: Section, changes: Iterable[Change], scenes: Iterable[str], *, each: bool) -> list[Cell]:
    """The cells to which changes are made: the scenes that were measured with them, for `each` traversal or for none.

    A scene that has nothing of what a change asks for was no part of that study and is left out.
    """
    asked = [{name: value for name, value in change.items() if name != "traversal"} for change in changes]
    had = {(cell.scene, cell.method, cell.layout, cell.sah) for cell in section.documents}

    def is_in(scene: str) -> bool:
        cells = [Cell(scene).changed(change) for change in asked]
        return all((cell.scene, cell.method, cell.layout, cell.sah) in had for cell in cells)

    return [Cell(scene, name) for scene in scenes if is_in(scene) for name in (TRAVERSALS if each else ("",))]


def collect(section: Section, cells: Iterable[Cell]) -> Cells:
    """The series of cells: each round's fastest frame, of as many as every round has, or for wall time its median."""
    rounds, missing = {}, []
    for cell in dict.fromkeys(cells):
        found = rounds_of(section.documents.get(cell), section.clock)
        if found:
            rounds[cell] = found
        else:
            missing.append(_why_missing(section, cell))
    shortest = min((len(frames) for each in rounds.values() for frames in each), default=0)
    number = min((len(each) for each in rounds.values()), default=0)
    series = {cell: _logarithms(each[:number], section.clock, shortest) for cell, each in rounds.items()}
    return Cells(series, tuple(missing))


def rounds_of(document: Json | None, clock: str) -> list[list[float]]:
    """A document's frame times by rounds; empty where any is missing or not positive."""
    if document is None:
        return []
    frames = document.get("frames_cpu_ms" if clock == "cpu" else "frames_ms")
    if not isinstance(frames, list) or not frames:
        return []
    if not all(isinstance(time, int | float) and 0 < time < math.inf for time in frames):
        return []
    return by_round(frames, document.get("frames_by_round"))


def pooled(baseline: Sequence[Series], against: Sequence[Series]) -> Difference:
    """The geometric mean over cells, round by round, of one side against that of the other."""
    first, second = (np.exp(np.mean(np.stack(side), axis=0)) for side in (baseline, against))
    return difference([[float(time)] for time in first], [[float(time)] for time in second])


def cell_difference(section: Section, baseline: Cell, against: Cell) -> Difference | str:
    """Two cells compared by their documents, or why they cannot be."""
    first, second = section.documents.get(baseline), section.documents.get(against)
    for cell in (baseline, against):
        if not rounds_of(section.documents.get(cell), section.clock):
            return _why_missing(section, cell)
    assert first is not None
    assert second is not None
    pair = pair_of(first, second, section.clock)
    if pair.apart:
        return f"{against.text}: its rounds did not alternate with those it is compared with"
    return pair.difference


def _why_missing(section: Section, cell: Cell) -> str:
    return f"{cell.text}: {'no frame times' if cell in section.documents else 'not measured'}"


def _logarithms(rounds: Sequence[Sequence[float]], clock: str, shortest: int) -> Series:
    figures = [min(frames[:shortest]) if clock == "cpu" else median(frames) for frames in rounds]
    logs: Series = np.log(np.array(figures))
    return logs
