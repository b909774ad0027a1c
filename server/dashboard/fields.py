"""A result's fields for its page, grouped, and a profile's metrics."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from server.comparison.figures import NOT_MEASURED

Field = tuple[str, str, bool]
FIGURES = ("count", "mean", "median", "min", "max")


def result_fields(document: dict[str, Any]) -> list[tuple[str, list[Field]]]:
    """Groups of (name, text, whether it was measured); the document's plain fields come first."""
    plain = {key: value for key, value in document.items() if not isinstance(value, dict)}
    groups = [("result", plain), *((key, value) for key, value in document.items() if isinstance(value, dict))]
    return [(name, [_field(key, value) for key, value in fields.items()]) for name, fields in groups]


def _field(name: str, value: Any) -> Field:
    if value is None:
        return name, NOT_MEASURED, False
    return name, _text(value), True


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:,.6g}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    if isinstance(value, list):
        return ", ".join(_text(item) for item in value) or "none"
    return json.dumps(value)


def metric_rows(metrics: Sequence[dict[str, Any]]) -> list[list[str]]:
    """A profile's metrics as texts: name, unit, number of values, mean, median, least, greatest."""
    return [
        [_series_name(metric), metric["unit"] or "", *(_text(metric[name]) for name in FIGURES)] for metric in metrics
    ]


def _series_name(metric: dict[str, Any]) -> str:
    instance = f"[{metric['instance']}]" if metric["instance"] else ""
    source = f" ({metric['source']})" if metric["source"] else ""
    return f"{metric['name']}{instance}{source}"
