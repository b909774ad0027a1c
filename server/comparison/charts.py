"""The charts of a comparison: what each draws, and its points as a table."""

from __future__ import annotations

from dataclasses import dataclass

from server.comparison.figures import write_figure, write_interval
from server.comparison.metrics import METRICS, Metric
from server.comparison.pareto import COSTS, fronts
from server.comparison.pivot import Cell, Comparison, label

SPEED = "speed"


@dataclass(frozen=True)
class Chart:
    """One chart. `x` is the metric of the horizontal axis and `y` of the vertical; without `x`, variants stand on it.

    An empty `y` is the comparison's own metric. `front` is the cost whose Pareto front is drawn (`pareto.COSTS`), and
    `paid` says what more speed off the front would cost.
    """

    label: str
    title: str
    x: str = ""
    y: str = ""
    front: str = ""
    paid: str = ""


def _against(cost: str, what: str, paid: str) -> Chart:
    """Speed against one of `pareto.COSTS`."""
    return Chart(f"speed against {what}", f"Speed against {what}", COSTS[cost], "mrays_per_s", cost, paid)


CHARTS = {
    SPEED: Chart("the metric, with intervals", ""),
    "error": _against("error", "error", "more error"),
    "edge": _against("edge", "edge cases", "more edge cases"),
    "shadow": _against("shadow", "shadow mismatches", "more shadow mismatches"),
    "ulp": _against("ulp", "the worst t", "a worse t"),
    "flip": _against("flip", "FLIP of the picture", "a higher FLIP"),
    "psnr": _against("psnr", "PSNR of the picture", "a lower PSNR"),
    "size": _against("size", "structure size", "more memory"),
    "work": Chart("nodes per ray against speed", "Nodes per ray against speed", "mrays_per_s", "per_ray_nodes"),
}
assert {chart.front for chart in CHARTS.values()} == {"", *COSTS}


@dataclass(frozen=True)
class Point:
    """A point of a chart in words; `front` tells whether it is on its column's Pareto front, None without one."""

    row: str
    column: str
    x: str
    y: str
    interval: str
    front: bool | None


def metrics_of(chart: Chart, table: Comparison) -> tuple[Metric | None, Metric]:
    """The metrics of the horizontal axis, None where variants stand on it, and of the vertical."""
    return METRICS[chart.x] if chart.x else None, METRICS[chart.y] if chart.y else table.metric


def points_of(chart: Chart, table: Comparison) -> list[Point]:
    """What a chart draws, column by column; cells that lack a figure have no point."""
    found = []
    lines = fronts(table, chart.front) if chart.front else [None] * len(table.column_keys)
    for j, (column, line) in enumerate(zip(table.column_keys, lines, strict=True)):
        for i, row in enumerate(table.row_keys):
            cell = table.cells[i][j]
            point = cell and _point(chart, table, cell, label(row), label(column), None if line is None else i in line)
            if point:
                found.append(point)
    return found


def _point(chart: Chart, table: Comparison, cell: Cell, row: str, column: str, on_front: bool | None) -> Point | None:
    across, up = metrics_of(chart, table)
    ours = cell.figures[up.key]
    theirs = cell.figures[across.key] if across else None
    if ours.value is None or (theirs and theirs.value is None):
        return None
    measured, figure = (across, theirs) if across and across.from_frames and theirs else (up, ours)
    x = write_figure(across, theirs) if across and theirs else ""
    return Point(row, column, x, write_figure(up, ours), write_interval(measured, figure), on_front)
