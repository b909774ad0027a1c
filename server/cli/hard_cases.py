"""`rayfarm study hard-cases`: every variant against every hard case, as a table of what it loses where."""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

from renderer.hard_cases.cell import FAULTS, WRONG
from renderer.hard_cases.study import Order, few_variants, run_order
from renderer.locks import holding, machine_lock
from renderer.variant import TRAVERSALS, Variant, expand
from scenes.hard_cases import FAMILIES
from server.cli.common import SOME_FAILED, Client, ClientError
from server.cli.reports import report_path
from server.hard_cases.document import NAME, study_document

Json = dict[str, Any]
RESCUED = Path("rayfarm-hard-cases.json")
"""Where a study goes that a service did not take."""
_ALSO = ("edge", "any_edge", "differs")
_WIDTH = 150


def hard_cases_here(
    traversal: str | None,
    output: Path | None,
    report: Path | None,
    as_json: bool,
    server: str | None = None,
    *,
    seed: int | None = None,
    share: float = 1.0,
) -> int:
    """Run the study here, show it, write it to `output` and its report to `report`, and hand it to `server`.

    The exit code is 1 when a promise is broken.
    """
    traversals = expand("traversal", traversal or "all")
    order = Order(few_variants(traversals), seed=Order.seed if seed is None else seed, share=share)
    path = report_path(NAME, report)
    if output is not None and not output.parent.is_dir():
        raise ClientError(f"The study cannot be written to {output}: there is no folder {output.parent}.")
    notes = Console(stderr=True, quiet=as_json, highlight=False, soft_wrap=True)
    with ExitStack() as stack:
        # Asked before it is run: the study takes minutes.
        client = None if server is None else stack.enter_context(Client(server))
        if client is not None:
            client.get("hard-cases")
        document = _run(order, notes)
        if output is not None:
            output.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        if path is not None:
            notes.print(_report(document, path), markup=False)
        if client is not None:
            notes.print(_hand_in(client, document), markup=False)
    if as_json:
        typer.echo(json.dumps(document))
    else:
        show(document, Console(highlight=False, width=None if sys.stdout.isatty() else _WIDTH))
    return SOME_FAILED if document["broken"] else 0


def _run(order: Order, notes: Console) -> Json:
    notes.print(f"{len(order.variants)} variants, {len(order.families)} families, seed {order.seed}")
    with holding(machine_lock(), lambda: notes.print("waiting for another measurement")), notes.status("") as status:
        started, begun = datetime.now(UTC), time.monotonic()
        ran = run_order(order, lambda done, lost: status.update(f"{done} cells done, {lost} lost"))
    return study_document(order, ran, started, time.monotonic() - begun)


def _report(document: Json, path: Path) -> str:
    from server.hard_cases.report import write_report

    try:
        write_report(document, path)
    except OSError as error:
        raise ClientError(f"The report cannot be written to {path}: {error.strerror or error}.") from error
    return f"The report is {path}."


def _hand_in(client: Client, document: Json) -> str:
    """Hand a study to a service; where that fails it is kept in a file."""
    try:
        line = client.submit("hard-cases", document)
    except ClientError as error:
        RESCUED.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        raise ClientError(f"{error} The study is kept in {RESCUED}: POST it to /api/v1/hard-cases.") from error
    return f"See it at {client.address}{line['page']}"


def show(document: Json, console: Console) -> None:
    """Print what variants lose where; those that lose the same are one row, and cells without a loss none."""
    cells = document["cells"]
    console.print(_variants_table(cells))
    console.print(_losses_table(cells))
    for title, outcome in (("Refused", "refused"), ("Left out", "left out")):
        told = {(row["family"], row["sentence"]) for row in cells if row["outcome"] == outcome}
        for family, sentence in sorted(told):
            console.print(f"{title}: {family}: {sentence}")
    console.print(_promises_table(document["promises"]))
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


def _promises_table(promises: Iterable[Json]) -> Table:
    table = Table("promise", "of which variants", "cells", "broken in")
    for promise in promises:
        table.add_row(promise["what"], promise["of"], str(promise["cells"]), str(promise["broken"]))
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
    """The values of the axes that tell rows apart; of some only those that are not the default."""
    variant = row["variant"]
    rest = [variant[axis] for axis in ("precision", "offset", "fetch") if variant[axis] != getattr(Variant(), axis)]
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
