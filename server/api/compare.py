"""GET /api/v1/compare: results side by side, as JSON or CSV."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse

from server.api.state import database_of
from server.comparison.flat import csv_lines, to_csv
from server.comparison.metrics import Figure
from server.comparison.pivot import Cell, CompareError, Comparison
from server.comparison.selection import Selection, load_comparison, load_rows, read_selection

router = APIRouter(prefix="/api/v1")
CSV = "text/csv; charset=utf-8"


@router.get("/compare")
def read_comparison(request: Request) -> Response:
    """Filters: scene, device, study and every axis, each with one or more values. `metric`, `rows`, `cols`, `sort`.

    `format=csv` gives one line a result, `_` between levels; with `shape=table` the metric's table. A text that a
    spreadsheet would take for a formula has an apostrophe in front.
    """
    params = request.query_params
    form = _choice("format", params.get("format") or "json", ("json", "csv"))
    shape = _choice("shape", params.get("shape") or "long", ("long", "table"))
    selection = read_selection(params)
    database = database_of(request)
    if form == "json":
        return JSONResponse(comparison_view(load_comparison(database, selection), selection))
    if shape == "table":
        text = to_csv(load_comparison(database, selection, limit=None).pivot(), index=True)
        return Response(text, media_type=CSV)
    rows = load_rows(database, selection)
    return StreamingResponse(csv_lines(rows, rows.fields), media_type=CSV)


def comparison_view(table: Comparison, selection: Selection) -> dict[str, Any]:
    """A comparison as plain JSON."""
    return {
        "metric": {"key": table.metric.key, "label": table.metric.label, "unit": table.metric.unit},
        "better": table.metric.better,
        "rows": list(table.rows),
        "columns": list(table.columns),
        "column_keys": [dict(zip(table.columns, key, strict=True)) for key in table.column_keys],
        "table": [
            {"key": dict(zip(table.rows, key, strict=True)), "cells": [cell and _cell_view(cell) for cell in line]}
            for key, line in zip(table.row_keys, table.cells, strict=True)
        ],
        "notes": table.notes,
        "results": len(table.flat),
        "page": f"/?{selection.query()}".rstrip("?"),
    }


def _cell_view(cell: Cell) -> dict[str, Any]:
    return {
        "job": cell.row["job"],
        "count": cell.count,
        "differs": list(cell.differs),
        "figures": {key: _figure_view(figure) for key, figure in cell.figures.items()},
        "result": cell.row,
    }


def _figure_view(figure: Figure) -> dict[str, float | None]:
    return {"value": figure.value, "low": figure.low, "high": figure.high}


def _choice(name: str, value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise CompareError(f"Unknown {name} {value!r}: choose one of {', '.join(allowed)}.")
    return value
