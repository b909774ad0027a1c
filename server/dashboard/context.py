"""What the comparison page's template is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from renderer.variant import AXES
from server.comparison.charts import CHARTS, metrics_of, points_of
from server.comparison.filters import NAMES
from server.comparison.metrics import METRICS
from server.comparison.pivot import DIMENSIONS, Comparison, label
from server.comparison.selection import Selection
from server.dashboard.cells import view_cells

LAYOUTS = (
    "traversal",
    "method",
    "layout",
    "intersector",
    "nodes",
    "builder",
    "fetch",
    "traversal,method",
    "traversal,layout",
    "traversal,method,layout",
    "traversal,intersector",
    "traversal,nodes",
    "traversal,builder",
    "traversal,fetch",
    "scene",
)
COLUMNS = (
    "scene",
    "device",
    "method",
    "layout",
    "fetch",
    "scene,method",
    "scene,layout",
    "scene,device",
    "traversal",
    "size",
    "sah",
    "specialise",
)


@dataclass(frozen=True)
class Option:
    """One value that a control offers."""

    value: str
    label: str
    chosen: bool


def comparison_context(
    table: Comparison, selection: Selection, known: dict[str, list[str]], studies: list[tuple[int, str]]
) -> dict[str, Any]:
    """Everything on the comparison page."""
    chart = CHARTS[selection.chart]
    across, up = metrics_of(chart, table)
    return {
        "table": table,
        "newcomer": not known["scene"],
        "cells": view_cells(table),
        "selection": selection,
        "query": selection.query(),
        "metrics": [Option(m.key, m.label, m is selection.metric) for m in METRICS.values()],
        "rows": _dimensions(LAYOUTS, selection.rows),
        "columns": _dimensions(COLUMNS, selection.columns),
        "sorts": _sorts(table, selection),
        "charts": [Option(key, one.label, key == selection.chart) for key, one in CHARTS.items()],
        "chart": {"title": chart.title or f"{up.label}, with 95 % intervals", "front": chart.front, "paid": chart.paid},
        "axes": {"x": across, "y": up},
        "points": points_of(chart, table),
        "against_error": f"/?{selection.query(chart='error')}",
        "baselines": _baselines(table, selection),
        "exports": [(name, f"/api/v1/compare?{selection.query(format=form)}") for form, name in EXPORTS.items()],
        "studies": [Option(str(key), f"{key}: {name}", key == selection.study) for key, name in studies],
        "filters": _filters(known, selection),
        "environments": table.environments,
        "row_heads": [list(key) for key in table.row_keys],
        "column_heads": [(label(key), _sort_link(selection, label(key))) for key in table.column_keys],
    }


EXPORTS = {
    "csv": "CSV",
    "parquet": "Parquet",
    "jsonl": "JSON Lines",
    "markdown": "Markdown",
    "latex": "LaTeX",
}


def _baselines(table: Comparison, selection: Selection) -> list[Option]:
    names = dict.fromkeys(
        [*(label(key) for key in table.row_keys), *([selection.baseline] if selection.baseline else [])]
    )
    chosen = selection.baseline
    return [Option("", "none", not chosen), *(Option(name, name, name == chosen) for name in names)]


def _dimensions(offered: tuple[str, ...], chosen: tuple[str, ...]) -> list[Option]:
    now = ",".join(chosen)
    values = dict.fromkeys((*offered, *DIMENSIONS, now))
    return [Option(value, value.replace(",", ", "), value == now) for value in values]


def _sorts(table: Comparison, selection: Selection) -> list[Option]:
    options = [Option("", "table order", not selection.sort)]
    for name in table.rows:
        options.append(Option(name, f"{name}, A to Z", selection.sort == name))
        options.append(Option(f"-{name}", f"{name}, Z to A", selection.sort == f"-{name}"))
    for key in table.column_keys:
        text = label(key)
        options.append(Option(text, f"best in {text}", selection.sort == text))
        options.append(Option(f"-{text}", f"worst in {text}", selection.sort == f"-{text}"))
    return options


def _sort_link(selection: Selection, column: str) -> str:
    return f"/?{selection.query(sort=f'-{column}' if selection.sort == column else column)}"


def _filters(known: dict[str, list[str]], selection: Selection) -> list[tuple[str, list[Option]]]:
    """A group of choices for every filter with a choice to make, in the axes' own order."""
    groups = []
    for name in NAMES:
        chosen = selection.filters.get(name, ())
        order = AXES.get(name, ())
        values = sorted({*known[name], *chosen}, key=lambda v: (order.index(v) if v in order else len(order), v))
        if len(values) > 1 or chosen:
            groups.append((name, [Option(value, value, value in chosen) for value in values]))
    return groups
