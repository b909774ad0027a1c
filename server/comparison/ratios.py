"""Cells held against a baseline row: the ratio of their figures, for speeds with its interval and a verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from renderer.times.difference import Difference, DifferenceError
from server.comparison.differences import Pair, pair_of

if TYPE_CHECKING:
    from server.comparison.metrics import Metric
    from server.comparison.pivot import Cell, Comparison

Json = dict[str, Any]

SHARED = {"scene": "scene", "size": "size", "rays": "rays_kind"}
"""What a cell must share with its baseline, and where it stands in a flat row."""
CLOCKS = {"mrays_per_s": "wall", "fps": "wall", "frame_ms_median": "wall", "mrays_per_cpu_s": "cpu"}
"""The metrics that rounds of frames are compared for, and by which clock."""
PER_RAY = ("mrays_per_s", "mrays_per_cpu_s")
OTHER_RAYS = 0.01
"""A ratio says so where more than this share of the rays are others, as with hybrid, which casts no primary rays."""
SOFTWARE = ("rayfarm", "plan", "shader_sha")
"""What of the environment is told where the devices are what is compared."""


@dataclass(frozen=True)
class Ratio:
    """A cell's figure by that of its baseline; above 1 it is the larger one.

    `low` and `high` bound it with 95 % confidence and `verdict` is that of `renderer.times.difference`, both by the
    rounds' frames; None where the metric has none. `value` is None where no ratio can be made, and `note` says why.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    verdict: str | None = None
    note: str = ""


def with_ratios(table: Comparison, documents: Mapping[int, Json]) -> Comparison:
    """The comparison with a ratio in every cell.

    `documents` are the cells' whole results by their jobs, where the metric is one of CLOCKS; else they are not read.
    """
    cells = [
        [
            cell and replace(cell, ratio=_ratio(table.metric, base, cell, documents))
            for base, cell in zip(table.base, line, strict=True)
        ]
        for line in table.cells
    ]
    return replace(table, cells=cells)


def _ratio(metric: Metric, base: Cell | None, cell: Cell, documents: Mapping[int, Json]) -> Ratio:
    ours = cell.figures[metric.key].value
    theirs = base.figures[metric.key].value if base else None
    if base is None or theirs is None:
        return Ratio(None, note="the baseline was not measured here")
    if ours is None:
        return Ratio(None, note="not measured")
    if cell.row["job"] == base.row["job"]:
        return Ratio(1.0, verdict="baseline")
    unlike = _unlike(base, cell)
    if unlike:
        return Ratio(None, note=f"no ratio: another {' and '.join(unlike)}")
    if metric.key in CLOCKS:
        return _of_rounds(metric, base, cell, documents)
    return Ratio(ours / theirs) if theirs else Ratio(None, note="no ratio: the baseline is 0")


def _of_rounds(metric: Metric, base: Cell, cell: Cell, documents: Mapping[int, Json]) -> Ratio:
    """A ratio of frame times, turned into one of speeds by the rays that each timed."""
    first, second = documents[int(base.row["job"])], documents[int(cell.row["job"])]
    try:
        pair = pair_of(first, second, CLOCKS[metric.key])
    except DifferenceError:
        ours, theirs = cell.figures[metric.key].value, base.figures[metric.key].value
        return Ratio(ours / theirs if ours is not None and theirs else None, note="no frames to compare")
    rays = (int(first.get("rays_timed") or 0), int(second.get("rays_timed") or 0))
    found = _scaled(pair.difference, rays[0] / rays[1]) if metric.key in PER_RAY and all(rays) else pair.difference
    note = "; ".join(_notes(pair, rays))
    if metric.better == "lower":
        return Ratio(found.ratio, found.low, found.high, found.verdict, note)
    low, high = (None if end is None else 1 / end for end in (found.high, found.low))
    return Ratio(1 / found.ratio, low, high, found.verdict, note)


def _scaled(found: Difference, factor: float) -> Difference:
    low, high = (None if end is None else end * factor for end in (found.low, found.high))
    return replace(found, ratio=found.ratio * factor, low=low, high=high)


def _notes(pair: Pair, rays: tuple[int, int]) -> list[str]:
    """What must be known beside a ratio."""
    notes = []
    devices = "device" in pair.environment
    names = [name for name in pair.environment if not devices or name in SOFTWARE]
    if names:
        notes.append(f"environments differ in {', '.join(names)}")
    if pair.apart and not devices:
        notes.append("measured one after the other")
    if all(rays) and abs(rays[1] / rays[0] - 1) > OTHER_RAYS:
        notes.append(f"{rays[1]:,} rays against {rays[0]:,}")
    if pair.difference.low is None:
        notes.append("no interval: fewer than 4 rounds")
    return notes


def _unlike(base: Cell, cell: Cell) -> list[str]:
    return [name for name, field in SHARED.items() if base.row.get(field) != cell.row.get(field)]
