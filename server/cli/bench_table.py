"""The results of `rayfarm bench` as a table in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from rich.text import Text

from renderer.bench import Result
from renderer.variant import Variant
from scenes.scene import Scene
from server.comparison.figures import write_interval, write_value
from server.comparison.flat import Stored, flatten
from server.comparison.metrics import METRICS, Flat, read_figure

UNMEASURED = "–"
WIDEST = 400


@dataclass(frozen=True)
class Column:
    """A column: its head and its metric. An `optional` one is left out where no result has it."""

    head: str
    metric: str
    interval: bool = False
    optional: bool = False


COLUMNS = (
    Column("Mray/s", "mrays_per_s"),
    Column("Mray/CPU-s", "mrays_per_cpu_s"),
    Column("frame ms", "frame_ms_median"),
    Column("95 % of it", "frame_ms_median", interval=True),
    Column("of Embree", "vs_embree_ratio"),
    Column("structure", "structure_bytes"),
    Column("nodes/ray", "per_ray_nodes"),
    Column("tri/ray", "per_ray_triangles"),
    Column("error", "error_total"),
    Column("edge", "error_edge"),
    Column("shadow", "error_shadow_mismatch"),
    Column("raster", "error_raster_mismatch", optional=True),
)


def print_results(scene: Scene, results: Sequence[Result], console: Console) -> None:
    """Print at least one result, a row each, what they share above them; may widen the console."""
    rows = [flatten(Stored(0, None, "", result)) for result in results]
    axes = _varying_axes(rows)
    columns = [column for column in COLUMNS if not column.optional or any(write_cell(column, row) for row in rows)]
    table = Table(box=None, pad_edge=False)
    for axis in axes:
        table.add_column(axis, no_wrap=True)
    for column in columns:
        table.add_column(column.head, justify="right", no_wrap=True)
    for row in rows:
        cells = (write_cell(column, row) or UNMEASURED for column in columns)
        table.add_row(*(Text(str(row[axis])) for axis in axes), *map(Text, cells))
    for line in _heading(scene, results[0], axes):
        console.print(Text(line))
    # A narrow terminal folds the lines; figures are never cut.
    needed = console.measure(table, options=console.options.update(width=WIDEST)).maximum
    console.width = max(needed, console.width)
    console.print(table)
    console.print(Text(f"Errors are fractions of rays; {UNMEASURED}: not measured.", style="dim"))


def write_cell(column: Column, row: Flat) -> str:
    """A figure with three significant digits; empty where it was not measured."""
    metric = METRICS[column.metric]
    figure = read_figure(metric, row)
    if figure.value is None:
        return ""
    return write_interval(metric, figure) if column.interval else write_value(metric, figure.value)


def _varying_axes(rows: Sequence[Flat]) -> list[str]:
    """The traversal, and the axes on which the results differ."""
    axes = Variant().as_dict()
    return [axis for axis in axes if axis == "traversal" or len({row[axis] for row in rows}) > 1]


def _heading(scene: Scene, result: Result, axes: Sequence[str]) -> list[str]:
    note = f" ({scene.note})" if scene.note else ""
    width, height = result["size"]
    shared = [result[axis] for axis in Variant().as_dict() if axis not in axes]
    said = [
        f"{width}x{height}",
        f"{result['rays_kind']} rays timed" if result["rays_kind"] != "both" else "primary and shadow rays timed",
        f"{result['frames']} frames",
        f"SAH {result['sah']['traversal']:g},{result['sah']['intersection']:g}",
        *shared,
    ]
    device = result["device"]
    return [
        f"{scene.name}{note}: {result['triangles']:,} triangles",
        ", ".join(said),
        ", ".join([device["name"], device["driver"], *_threads(device.get("threads"))]),
    ]


def _threads(count: int | None) -> list[str]:
    """Rasteriser threads; a phone's GPU has none."""
    return [] if count is None else [f"{count} thread{'s' * (count != 1)}"]
