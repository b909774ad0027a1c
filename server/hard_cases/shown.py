"""What pages and the report show of a study: facts, promises, tables, and what could not be run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from server.hard_cases.matrix import View, chosen, kind_of, make_matrix
from server.hard_cases.words import count_name, counts_of, write_cost, write_ulps

Json = dict[str, Any]
DEVICE = {"name": "Device", "driver": "Driver", "threads": "Rasteriser threads", "cores": "Cores", "machine": "Machine"}
VERSIONS = {"rayfarm": "RayFarm", "plan": "Plan format", "shader_sha": "Shaders"}


@dataclass(frozen=True)
class Untold:
    """Cells that were refused, left out, crashed or hung with one sentence, by family."""

    outcome: str
    family: str
    sentence: str
    variants: int


def facts(document: Json) -> list[tuple[str, str]]:
    """Names and values of how a study was run."""
    device, versions = document["device"] or {}, document["versions"]
    told = [(label, device.get(name)) for name, label in DEVICE.items()]
    told += [(VERSIONS.get(name, name), str(value)[:12]) for name, value in versions.items()]
    told += [
        ("Seed", document["seed"]),
        ("Share of the rays", f"{document['share'] * 100:g} %"),
        ("Begun", (document["started_at"] or "")[:19].replace("T", " ")),
        ("Took", None if document["seconds"] is None else f"{document['seconds'] / 60:.1f} min"),
    ]
    return [(name, str(value)) for name, value in told if value not in (None, "")]


def headline(document: Json) -> Json:
    """How many variants, families, cells and rays, and what came of them."""
    cells = document["cells"]
    outcomes = [cell["outcome"] for cell in cells]
    return {
        "variants": len({tuple(cell["variant"].values()) for cell in cells}),
        "families": len(document["families"]),
        "cells": len(cells),
        "rays": sum(cell["rays"] for cell in cells if cell["outcome"] == "ran"),
        "outcomes": [(outcome, outcomes.count(outcome)) for outcome in dict.fromkeys(sorted(outcomes))],
    }


def untold(cells: Sequence[Json]) -> list[Untold]:
    """What did not run to its end, with its sentence."""
    found: dict[tuple[str, str, str], int] = {}
    for cell in cells:
        if cell["outcome"] != "ran":
            key = (cell["outcome"], cell["family"], cell["sentence"])
            found[key] = found.get(key, 0) + 1
    return [Untold(*key, number) for key, number in sorted(found.items())]


def study_parts(document: Json, view: View, most: int) -> Json:
    """What a page and the report have in common."""
    cells = chosen(document["cells"], view)
    return {
        "facts": facts(document),
        "headline": headline(document),
        "promises": document["promises"],
        "broken": document["broken"],
        "matrix": make_matrix(document, view, most),
        "untold": untold(cells),
    }


def family_table(document: Json, family: str, view: View) -> Json:
    """Every figure of a family's cells, a row for each variant; columns without a figure are left out."""
    cells = [cell for cell in chosen(document["cells"], view) if cell["family"] == family]
    axes = list(cells[0]["variant"]) if cells else []
    varying = [axis for axis in axes if len({cell["variant"][axis] for cell in cells}) > 1] or axes[:1]
    counts = [
        name
        for name in dict.fromkeys(name for cell in cells for name in counts_of(cell))
        if any(cell.get(name) is not None for cell in cells)
    ]
    return {
        "axes": varying,
        "shared": [f"{axis} {cells[0]['variant'][axis]}" for axis in axes if axis not in varying],
        "counts": [count_name(name) for name in counts],
        "rows": [_row(cell, varying, counts) for cell in cells],
    }


def _row(cell: Json, axes: Sequence[str], counts: Sequence[str]) -> Json:
    number = [None if cell.get(name) is None else f"{cell[name]:,}" for name in counts]
    return {
        "values": [cell["variant"][axis] for axis in axes],
        "kind": kind_of([cell]),
        "outcome": cell["outcome"],
        "sentence": cell["sentence"],
        "broken": cell["broken"],
        "counts": number,
        "ulps": None if cell["t_ulp_max"] is None else write_ulps(cell["t_ulp_max"]),
        "cost": None if cell["cost"] is None else write_cost(cell["cost"]),
        "fitted": {None: "", True: "same bits", False: "other bits"}[cell["fitted"]],
    }
