"""GET /api/v1/compare: results side by side, as JSON, as a file of all results, or as a table to paste."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse

from server.api.state import database_of
from server.comparison.flat import csv_lines, to_csv
from server.comparison.metrics import Figure
from server.comparison.pareto import COSTS, fronts
from server.comparison.parquet import parquet_pieces
from server.comparison.pivot import Cell, CompareError, Comparison, label
from server.comparison.selection import Selection, load_comparison, load_rows, read_selection
from server.comparison.stored_rows import StoredRows
from server.comparison.written import to_latex, to_markdown

router = APIRouter(prefix="/api/v1")

FILES: dict[str, tuple[str, str, Callable[[StoredRows], Any]]] = {
    "csv": ("text/csv; charset=utf-8", "", lambda rows: csv_lines(rows, rows.fields)),
    "jsonl": ("application/jsonl", "rayfarm.jsonl", lambda rows: rows.json_lines()),
    "parquet": (
        "application/vnd.apache.parquet",
        "rayfarm.parquet",
        lambda rows: parquet_pieces(rows.rows(lists=True), rows.fields),
    ),
}
"""What holds all results: its media type, the name to save it by where a browser should, and what writes it."""
TABLES: dict[str, tuple[str, Callable[[Comparison], str]]] = {
    "markdown": ("text/markdown; charset=utf-8", to_markdown),
    "latex": ("text/plain; charset=utf-8", to_latex),
}
"""What holds the table as it is shown."""
FORMATS = ("json", *FILES, *TABLES)


@router.get("/compare")
def read_comparison(request: Request) -> Response:
    """Filters: scene, device, study, size, rays, sah, specialise and every axis, each with one or more values.

    `metric`, `rows`, `cols`, `sort`; `baseline` is the label of a row that every other is held against. With
    `cells=results` a cell has its result without raw series. `format=csv`, `jsonl` and `parquet` give every result:
    flat rows, `_` between levels, but whole documents as `jsonl`; `markdown` and `latex` the table. With `shape=table`
    a CSV is the metric's table. A text in a CSV that a spreadsheet would take for a formula has an apostrophe in front.
    """
    params = request.query_params
    form = _choice("format", params.get("format") or "json", FORMATS)
    shape = _choice("shape", params.get("shape") or "long", ("long", "table"))
    whole = _choice("cells", params.get("cells") or "figures", ("figures", "results")) == "results"
    selection = read_selection(params)
    database = database_of(request)
    if form == "json":
        return JSONResponse(comparison_view(load_comparison(database, selection), selection, whole))
    if form in TABLES:
        media_type, write = TABLES[form]
        return Response(write(load_comparison(database, selection)), media_type=media_type)
    media_type, name, pieces = FILES[form]
    if form == "csv" and shape == "table":
        return Response(
            to_csv(load_comparison(database, selection, limit=None).pivot(), index=True), media_type=media_type
        )
    headers = {"Content-Disposition": f'attachment; filename="{name}"'} if name else {}
    return StreamingResponse(pieces(load_rows(database, selection)), media_type=media_type, headers=headers)


def comparison_view(table: Comparison, selection: Selection, whole: bool = False) -> dict[str, Any]:
    """A comparison as plain JSON; with `whole`, every cell has its result without raw series.

    `pareto` gives, per cost, each column's front of speed against it as places in `table`, or null where a column mixes
    scenes, sizes or rays.
    """
    return {
        "metric": {"key": table.metric.key, "label": table.metric.label, "unit": table.metric.unit},
        "better": table.metric.better,
        "model": bool(table.metric.model),
        "rows": list(table.rows),
        "columns": list(table.columns),
        "column_keys": [dict(zip(table.columns, key, strict=True)) for key in table.column_keys],
        "baseline": selection.baseline if table.base else None,
        "table": [
            {
                "key": dict(zip(table.rows, key, strict=True)),
                "label": label(key),
                "cells": [cell and _cell_view(cell, whole) for cell in line],
            }
            for key, line in zip(table.row_keys, table.cells, strict=True)
        ],
        "pareto": {cost: fronts(table, cost) for cost in COSTS},
        "notes": table.notes,
        "results": len(table.flat),
        "page": f"/?{selection.query()}".rstrip("?"),
    }


def _cell_view(cell: Cell, whole: bool) -> dict[str, Any]:
    return {
        "job": cell.row["job"],
        "count": cell.count,
        "differs": list(cell.differs),
        "figures": {key: _figure_view(figure) for key, figure in cell.figures.items()},
        "ratio": cell.ratio and asdict(cell.ratio),
        **({"result": cell.row} if whole else {}),
    }


def _figure_view(figure: Figure) -> dict[str, float | None]:
    return {"value": figure.value, "low": figure.low, "high": figure.high}


def _choice(name: str, value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise CompareError(f"Unknown {name} {value!r}: choose one of {', '.join(allowed)}.")
    return value
