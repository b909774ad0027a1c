"""What the comparison page's template is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from renderer.variant import AXES
from server.comparison.metrics import METRICS
from server.comparison.pivot import DIMENSIONS, Comparison, label
from server.comparison.selection import CHARTS, Selection
from server.dashboard.cells import view_cells
from server.store.models import FILTERS

LAYOUTS = ("traversal", "method", "layout", "traversal,method", "traversal,layout", "traversal,method,layout", "scene")
COLUMNS = ("scene", "device", "method", "layout", "scene,method", "scene,layout", "scene,device", "traversal", "size")


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
    return {
        "table": table,
        "cells": view_cells(table),
        "selection": selection,
        "query": selection.query(),
        "metrics": [Option(m.key, m.label, m is selection.metric) for m in METRICS.values()],
        "rows": _dimensions(LAYOUTS, selection.rows),
        "columns": _dimensions(COLUMNS, selection.columns),
        "sorts": _sorts(table, selection),
        "charts": [Option(key, _CHART_LABELS[key], key == selection.chart) for key in CHARTS],
        "studies": [Option(str(key), f"{key}: {name}", key == selection.study) for key, name in studies],
        "filters": _filters(known, selection),
        "environments": table.environments,
        "row_heads": [list(key) for key in table.row_keys],
        "column_heads": [(label(key), _sort_link(selection, label(key))) for key in table.column_keys],
    }


_CHART_LABELS = {"speed": "the metric, with intervals", "error": "speed against error"}


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
    for name in FILTERS:
        chosen = selection.filters.get(name, ())
        order = AXES.get(name, ())
        values = sorted({*known[name], *chosen}, key=lambda v: (order.index(v) if v in order else len(order), v))
        if len(values) > 1 or chosen:
            groups.append((name, [Option(value, value, value in chosen) for value in values]))
    return groups
