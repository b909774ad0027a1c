"""Studies of hard cases: their list, one as a table of families by variants, one of its families, and two compared."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from server.api.state import database_of
from server.dashboard.context import Option
from server.dashboard.templates import render
from server.guard import CSP, REPORT_POLICY
from server.hard_cases.changes import find_changes
from server.hard_cases.matrix import ALL, LOSSES, MOST_COLUMNS, View, axes_of, read_view
from server.hard_cases.report import render_report
from server.hard_cases.shown import facts, family_table, study_parts
from server.hard_cases.store import find_run, list_runs
from server.problems import Problem

router = APIRouter(prefix="/hard-cases", include_in_schema=False)
SHOWN = 100
MOST_CHANGES = 500
ROWS = {ALL: "all families", LOSSES: "those with errors"}
Json = dict[str, Any]


@router.get("")
def runs_page(request: Request) -> Response:
    """The latest runs, and a form that holds two of them against each other."""
    with database_of(request).reading() as session:
        runs = list_runs(session, SHOWN)
    return render(request, "hard_cases.html", {"runs": runs})


@router.get("/difference")
def difference_page(request: Request) -> Response:
    """Two runs held against each other; the query string is the whole state."""
    params = request.query_params
    with database_of(request).reading() as session:
        runs = list_runs(session, SHOWN)
        sides = [find_run(session, params.get(name) or "") for name in ("baseline", "against")]
    found = find_changes(sides[0].document, sides[1].document)
    context = {
        "runs": runs,
        "baseline": sides[0].id,
        "against": sides[1].id,
        "found": found,
        "shown": found.cells[:MOST_CHANGES],
        "promises": _promises(sides[0].document, sides[1].document),
    }
    return render(request, "hard_cases_difference.html", context)


@router.get("/{run_id}")
def run_page(run_id: str, request: Request) -> Response:
    """One run: its promises, and its table; the query string is the whole state."""
    with database_of(request).reading() as session:
        document = find_run(session, run_id).document
    axes = axes_of(document["cells"])
    view = read_view(axes, request.query_params.multi_items())
    context = {
        "run": int(run_id),
        "axes": [(axis, [Option(value, value, value in view.filters.get(axis, ())) for value in values])
                 for axis, values in axes.items()],
        "columns": _columns(list(axes), view),
        "shows": [Option(value, text, value == view.show) for value, text in ROWS.items()],
        "filters": len(view.filters),
        "query": view.query(),
        **study_parts(document, view, MOST_COLUMNS),
    }  # fmt: skip
    return render(request, "hard_cases_run.html", context)


@router.get("/{run_id}/report")
def report_page(run_id: str, request: Request) -> Response:
    """One run as a page that needs no other, to be saved."""
    with database_of(request).reading() as session:
        document = find_run(session, run_id).document
    headers = {"Content-Disposition": f'attachment; filename="rayfarm-hard-cases-{int(run_id)}.html"'}
    return HTMLResponse(render_report(document), headers=headers | {CSP: REPORT_POLICY})


@router.get("/{run_id}/families/{family:path}")
def family_page(run_id: str, family: str, request: Request) -> Response:
    """One family of a run: every variant with every figure."""
    with database_of(request).reading() as session:
        document = find_run(session, run_id).document
    known = next((one for one in document["families"] if one["name"] == family), None)
    if known is None:
        raise Problem(404, f"Run {run_id} has no family {family!r}.")
    view = read_view(axes_of(document["cells"]), request.query_params.multi_items())
    context = {"run": int(run_id), "family": known, "query": view.query(), "facts": facts(document)}
    return render(request, "hard_cases_family.html", context | family_table(document, family, view))


def _columns(axes: list[str], view: View) -> list[Option]:
    """What may stand on the columns: all axes but one, each alone, all."""
    without_one = [tuple(other for other in axes if other != axis) for axis in axes]
    offered = dict.fromkeys([*without_one, *((axis,) for axis in axes), tuple(axes), view.columns])
    return [Option(",".join(one), ", ".join(one) or "all variants in one", one == view.columns) for one in offered]


def _promises(baseline: Json, against: Json) -> list[tuple[Json | None, Json | None]]:
    """The promises of both runs, by name."""
    first, second = ({one["name"]: one for one in document["promises"]} for document in (baseline, against))
    return [(first.get(name), second.get(name)) for name in dict.fromkeys((*first, *second))]
