"""`rayfarm study hard-cases`: every variant against every hard case, as a table of what it loses where."""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

from renderer.hard_cases.cell import FAULTS, WRONG
from renderer.hard_cases.promises import broken
from renderer.hard_cases.study import Order, few_variants, run_order
from renderer.locks import holding, machine_lock
from renderer.variant import TRAVERSALS, Variant, expand
from scenes.hard_cases import FAMILIES
from server.cli.common import SOME_FAILED

Json = dict[str, Any]
NAME = "hard-cases"
_ALSO = ("edge", "any_edge", "differs")
_WIDTH = 150


def hard_cases_here(
    traversal: str | None, output: Path | None, as_json: bool, *, seed: int | None = None, share: float = 1.0
) -> int:
    """Run the study here, show it, and write it to `output`; the exit code, 1 when a promise is broken."""
    traversals = expand("traversal", traversal or "all")
    order = Order(few_variants(traversals), seed=Order.seed if seed is None else seed, share=share)
    notes = Console(stderr=True, quiet=as_json, highlight=False, soft_wrap=True)
    notes.print(f"{len(order.variants)} variants, {len(order.families)} families, seed {order.seed}")
    with holding(machine_lock(), lambda: notes.print("waiting for another measurement")), notes.status("") as status:
        rows = run_order(order, lambda done, lost: status.update(f"{done} cells done, {lost} lost"))
    document = study_document(order, rows)
    if output is not None:
        output.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps(document))
    else:
        show(document, Console(highlight=False, width=None if sys.stdout.isatty() else _WIDTH))
    return SOME_FAILED if document["broken"] else 0


def study_document(order: Order, rows: Sequence[Json]) -> Json:
    """The study as one plain document: what was run, the families, every cell, and the promises broken."""
    families = [
        {"name": name, "reason": FAMILIES[name].reason, "source": FAMILIES[name].source} for name in order.families
    ]
    return {
        "study": NAME,
        "seed": order.seed,
        "share": order.share,
        "families": families,
        "cells": list(rows),
        "broken": broken(rows),
    }


def show(document: Json, console: Console) -> None:
    """Print what variants lose where; those that lose the same are one row, and cells without a loss none."""
    cells = document["cells"]
    console.print(_variants_table(cells))
    console.print(_losses_table(cells))
    for title, outcome in (("Refused", "refused"), ("Left out", "left out")):
        told = {(row["family"], row["sentence"]) for row in cells if row["outcome"] == outcome}
        for family, sentence in sorted(told):
            console.print(f"{title}: {family}: {sentence}")
    console.print(f"{len(document['broken'])} promises broken.")
    for sentence in document["broken"]:
        console.print(f"  {sentence}")


def _variants_table(cells: Iterable[Json]) -> Table:
    table = Table("variant", "traversals", "cells", "false", "holes", "edge", "differs", "faults", "NaN, inf cost")
    for axes, rows in _grouped(cells, _axes).items():
        ran = [row for row in rows if row["outcome"] == "ran"]
        totals = (_total(ran, names) for names in (WRONG[:3], ("hole",), ("edge",), ("differs",), FAULTS))
        table.add_row(axes, _traversals(rows), str(len(ran)), *totals, _worst_cost(ran))
    return table


def _losses_table(cells: Iterable[Json]) -> Table:
    """A row for each family and variant in which some traversal has something to say, counts from least to most."""
    table = Table("family", "rays", "variant", "traversals", "what")
    for (family, axes), rows in _grouped(cells, lambda row: (row["family"], _axes(row))).items():
        telling = [row for row in rows if _tells(row)]
        if telling:
            table.add_row(family, str(telling[0]["rays"]), axes, _traversals(telling), _what(telling))
    return table


def _tells(row: Json) -> bool:
    """Whether a cell has something to say: errors and faults; edge counts alone are none."""
    lost = row["outcome"] in ("crashed", "hung") or row["fitted"] is False
    return lost or any(row.get(name) for name in (*WRONG, *FAULTS))


def _what(rows: Sequence[Json]) -> str:
    said = sorted({f"{row['outcome']}: {row['sentence']}" for row in rows if row["outcome"] != "ran"})
    if any(row["fitted"] is False for row in rows):
        said.append("the specialised text differs")
    ran = [row for row in rows if row["outcome"] == "ran"]
    for name in (*WRONG, *FAULTS, *_ALSO):
        counts = sorted({row.get(name) or 0 for row in ran})
        twin = name.removeprefix("any_")
        # "Any hit" errs as the closest hit does nearly always; it is told where it does not.
        if counts and counts[-1] and (twin == name or any(row[name] != row[twin] for row in ran)):
            said.append(f"{'-'.join(dict.fromkeys(str(count) for count in (counts[0], counts[-1])))} {name}")
    return ", ".join(said)


def _grouped(cells: Iterable[Json], key: Any) -> dict[Any, list[Json]]:
    groups: dict[Any, list[Json]] = defaultdict(list)
    for row in cells:
        groups[key(row)].append(row)
    return dict(sorted(groups.items()))


def _axes(row: Json) -> str:
    """The values of the axes that tell rows apart; of precision and offset only those that are not the default."""
    variant = row["variant"]
    rest = [variant[axis] for axis in ("precision", "offset") if variant[axis] != getattr(Variant(), axis)]
    return " ".join([variant["intersector"], variant["box"], variant["nodes"], *rest])


def _traversals(rows: Iterable[Json]) -> str:
    used = {row["variant"]["traversal"] for row in rows}
    structures = {kind: {name for name, row in TRAVERSALS.items() if row.structure == kind} for kind in ("bvh", "kd")}
    if used == set(TRAVERSALS):
        return "all"
    whole = [kind for kind, names in structures.items() if names <= used]
    rest = used - {name for kind in whole for name in structures[kind]}
    return ", ".join([*(f"all {kind}" for kind in whole), *(name for name in TRAVERSALS if name in rest)])


def _total(rows: Iterable[Json], names: Iterable[str]) -> str:
    return str(sum(row.get(name) or 0 for row in rows for name in names))


def _worst_cost(rows: Iterable[Json]) -> str:
    costs = [row["cost"] for row in rows if FAMILIES[row["family"]].bar is not None and row["cost"] is not None]
    return f"{max(costs):.2f}" if costs else ""
