"""A comparison's cells as the page shows them: texts, a bar, and which is best in its column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from server.comparison.figures import write_figure, write_interval, write_times, write_value
from server.comparison.metrics import METRICS, Figure, Metric
from server.comparison.pivot import Cell, Comparison

SHOWN = {
    "mrays_per_s": "speed",
    "vs_embree_ratio": "of Embree",
    "structure_bytes": "size",
    "per_ray_nodes": "nodes/ray",
    "error_total": "error",
}
"""What every cell shows beside the chosen metric, with its short name: speed, its ratio, size, work and error."""

ERROR_DETAILS = (("error_edge", "edge"), ("error_shadow_mismatch", "shadow"), ("error_raster_mismatch", "raster"))


@dataclass(frozen=True)
class Line:
    """One of a cell's smaller figures."""

    name: str
    text: str
    measured: bool
    detail: str = ""


@dataclass(frozen=True)
class Bar:
    """A bar from 0 to `width` and the interval from `low` to `high`, in percent of the column's greatest value."""

    width: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class RatioView:
    """A ratio to the baseline; `links` are (text, address) of what shows the pair. `text` is empty without a ratio."""

    text: str
    interval: str
    verdict: str
    note: str
    links: list[tuple[str, str]]


@dataclass(frozen=True)
class CellView:
    """One cell of the page's table; `clear` says that its column's best is apart from the others' intervals."""

    value: str
    unit: str
    interval: str
    measured: bool
    best: bool
    clear: bool
    bar: Bar | None
    lines: list[Line]
    note: str
    job: int
    ratio: RatioView | None


def view_cells(table: Comparison) -> list[list[CellView | None]]:
    """The table's cells for the page, row by row."""
    columns = list(zip(*table.cells, strict=True)) if table.cells else []
    best = [_best(table.metric, column) for column in columns]
    scale = [_scale(table.metric, column) for column in columns]
    clear = [_is_clear(table.metric, column, cell) for column, cell in zip(columns, best, strict=True)]
    base = table.base or [None] * len(columns)
    return [
        [_view(table.metric, c, base[j], c is best[j], clear[j], scale[j]) if c else None for j, c in enumerate(line)]
        for line in table.cells
    ]


def _view(metric: Metric, cell: Cell, base: Cell | None, best: bool, clear: bool, scale: float) -> CellView:
    figure = cell.figures[metric.key]
    measured = figure.value is not None
    return CellView(
        value=write_value(metric, figure.value),
        unit=metric.unit if measured else "",
        interval=write_interval(metric, figure),
        measured=measured,
        best=best,
        clear=clear,
        bar=_bar(figure, scale),
        lines=[_line(cell, key) for key in SHOWN if key != metric.key],
        note=_note(cell),
        job=int(cell.row["job"]),
        ratio=_ratio(cell, base),
    )


def _ratio(cell: Cell, base: Cell | None) -> RatioView | None:
    ratio = cell.ratio
    if ratio is None:
        return None
    if ratio.verdict == "baseline" or base is None:
        return RatioView("", "", ratio.verdict or "", ratio.note, [])
    pair = f"baseline=job:{base.row['job']}&against=job:{cell.row['job']}"
    links = [] if ratio.verdict is None else [("difference", f"/difference?{pair}")]
    if base.row.get("pictures_image") and cell.row.get("pictures_image"):
        links.append(("pictures", f"/pictures?baseline={base.row['job']}&against={cell.row['job']}"))
    ends = (
        ""
        if ratio.low is None or ratio.high is None
        else f"{write_times(ratio.low)[:-1]}–{write_times(ratio.high)[:-1]}"
    )
    return RatioView(
        "" if ratio.value is None else write_times(ratio.value), ends, ratio.verdict or "", ratio.note, links
    )


def _line(cell: Cell, key: str) -> Line:
    metric, figure = METRICS[key], cell.figures[key]
    detail = _error_details(cell) if key == "error_total" else write_interval(metric, figure)
    text = write_figure(metric, figure) if key == "mrays_per_s" else write_value(metric, figure.value)
    return Line(SHOWN[key], text, figure.value is not None, detail)


def _error_details(cell: Cell) -> str:
    known = [(METRICS[key], cell.figures[key], name) for key, name in ERROR_DETAILS]
    return ", ".join(f"{name} {write_value(m, figure.value)}" for m, figure, name in known if figure.value is not None)


def _note(cell: Cell) -> str:
    if cell.count == 1:
        return ""
    return f"latest of {cell.count}" + (f", which differ in {', '.join(cell.differs)}" if cell.differs else "")


def _best(metric: Metric, column: Sequence[Cell | None]) -> Cell | None:
    """The column's best cell, where there is something to compare and one cell alone is best."""
    values = [(value, cell) for cell in column if cell and (value := cell.figures[metric.key].value) is not None]
    if len(values) < 2:
        return None
    chosen = (max if metric.better == "higher" else min)(value for value, _ in values)
    winners = [cell for value, cell in values if value == chosen]
    return winners[0] if len(winners) == 1 else None


def _is_clear(metric: Metric, column: Sequence[Cell | None], best: Cell | None) -> bool:
    """Whether the best cell's interval, where there is one, meets no other cell's."""

    def ends(cell: Cell) -> tuple[float, float] | None:
        figure = cell.figures[metric.key]
        return None if figure.low is None or figure.high is None else (figure.low, figure.high)

    ours = ends(best) if best else None
    others = [other for cell in column if cell and cell is not best and (other := ends(cell))]
    return ours is None or all(other[1] < ours[0] or ours[1] < other[0] for other in others)


def _scale(metric: Metric, column: Sequence[Cell | None]) -> float:
    figures = [cell.figures[metric.key] for cell in column if cell]
    return max((max(figure.value or 0.0, figure.high or 0.0) for figure in figures), default=0.0)


def _bar(figure: Figure, scale: float) -> Bar | None:
    if figure.value is None or scale <= 0:
        return None

    def part(value: float | None) -> float | None:
        return None if value is None else round(100 * value / scale, 2)

    return Bar(round(100 * max(figure.value, 0.0) / scale, 2), part(figure.low), part(figure.high))
