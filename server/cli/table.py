"""The comparison as a table in the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from server.comparison.figures import NOT_MEASURED, write_figure, write_interval, write_ratio, write_value
from server.comparison.metrics import METRICS, Figure, Metric
from server.comparison.ratios import Ratio

Json = dict[str, Any]


def print_comparison(view: Json, console: Console) -> None:
    """Print a comparison as the API gives it (`server.api.compare.comparison_view`)."""
    if not view["table"]:
        console.print("No result matches.")
        return
    metric = METRICS[view["metric"]["key"]]
    table = Table(title=f"{metric.label}, {metric.better} is better", title_justify="left", show_lines=True)
    for name in view["rows"]:
        table.add_column(name, style="bold")
    for key in view["column_keys"]:
        table.add_column(Text(" / ".join(key.values())))
    for row in view["table"]:
        cells = [_cell_text(metric, cell) for cell in row["cells"]]
        table.add_row(*(Text(name) for name in row["key"].values()), *cells)
    console.print(table)
    for note in view["notes"]:
        console.print(Text(note, style="yellow"))


def print_fronts(view: Json, cost: str, console: Console) -> None:
    """Print which variants are on each column's Pareto front of speed against `error` or `size`."""
    for key, front in zip(view["column_keys"], view["pareto"][cost], strict=True):
        names = "none: the column mixes scenes, sizes or rays"
        if front is not None:
            names = ", ".join(view["table"][place]["label"] for place in front) or NOT_MEASURED
        console.print(Text(f"Pareto front of speed against {cost}, {' / '.join(key.values())}: {names}"))


def _cell_text(metric: Metric, cell: Json | None) -> Text:
    if cell is None:
        return Text(NOT_MEASURED, style="dim")
    figures = {key: Figure(**figure) for key, figure in cell["figures"].items()}
    interval = write_interval(metric, figures[metric.key])
    text = Text(write_figure(metric, figures[metric.key]), style="bold")
    text.append(f"  {interval}" if interval else "", style="not bold dim")
    if cell.get("ratio"):
        text.append(f"\n{write_ratio(Ratio(**cell['ratio']))}", style="not bold cyan")
    for line in _lines(metric, figures):
        text.append(f"\n{line}", style="not bold")
    if cell["count"] > 1:
        text.append(f"\nlatest of {cell['count']}", style="not bold yellow")
    return text


def _lines(chosen: Metric, figures: dict[str, Figure]) -> list[str]:
    """Speed, ratio, size and work, error: all of them with every metric."""
    plain = {key: write_value(METRICS[key], figures[key].value) for key in figures}
    return [
        *([] if chosen.key == "mrays_per_s" else [write_figure(METRICS["mrays_per_s"], figures["mrays_per_s"])]),
        f"Embree ratio {plain['vs_embree_ratio']}, nodes/ray {plain['per_ray_nodes']}",
        f"structure {plain['structure_bytes']}",
        ", ".join([f"error {plain['error_total']}", *_error_details(figures)]),
    ]


def _error_details(figures: dict[str, Figure]) -> list[str]:
    known = {"edge": "error_edge", "shadow": "error_shadow_mismatch", "raster": "error_raster_mismatch"}
    measured = {name: (METRICS[key], figures[key].value) for name, key in known.items()}
    return [f"{name} {write_value(*pair)}" for name, pair in measured.items() if pair[1] is not None]
