"""Variants compiled for phone GPUs: a form and the newest estimates, and one GPU's listing beside the GLSL."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.phone_compile.gpus import GPUS, USUAL
from renderer.phone_compile.result import COMPILERS
from renderer.variant import AXES, Variant
from server.api.compiled import compilers_here, listing_of, result_of_job
from server.api.state import database_of
from server.compiled.measured import measured_on
from server.dashboard.templates import render
from server.scene_list import list_scenes
from server.store.models import Result

router = APIRouter(include_in_schema=False)
Json = dict[str, Any]

SHOWN = 40
"""How many results the page lists, the newest first."""
CHOSEN = ("traversal", "method", "layout")
"""The axes that the form offers; the command line and the API have them all."""


@router.get("/compile")
def compile_page(request: Request) -> Response:
    """A form, and the newest estimates."""
    with database_of(request).reading() as session:
        rows = _newest(session)
    context = {
        "compilers": compilers_here(),
        "gpus": [(gpu.name, gpu.label, gpu.name in USUAL) for gpu in GPUS.values()],
        "scenes": [scene for scene in list_scenes() if scene["here"]],
        "axes": {axis: AXES[axis] for axis in CHOSEN},
        "defaults": Variant().as_dict(),
        "rows": rows,
    }
    return render(request, "compile.html", context)


@router.get("/jobs/{job_id}/listing")
def listing_page(job_id: str, request: Request, gpu: str = Query(max_length=100)) -> Response:
    """A GPU's disassembly, block by block with how often each runs, beside the GLSL."""
    with database_of(request).reading() as session:
        document = result_of_job(session, job_id)
    listing = listing_of(request, job_id, document, gpu)
    rows = document["compiled"]["gpus"]
    context = {
        "job": int(job_id),
        "gpu": gpu,
        "row": next(row for row in rows if row["gpu"] == gpu),
        "others": [row["gpu"] for row in rows],
        "title": f"{document['scene']}, {document['traversal']} {document['method']} {document['layout']}",
        "blocks": listed_blocks(listing["disassembly"] or [], listing["weights"] or []),
        "glsl": (listing["glsl"] or "").splitlines(),
    }
    return render(request, "listing.html", context)


def compiled_rows(session: Session, document: Json, job: int) -> list[Json]:
    """A compiled result's rows for a table, each with what a phone measured."""
    shared = {name: document.get(name) for name in ("scene", *AXES)} | {"job": job}
    beside = measured_on(session, document)
    return [{**row, **shared, "measured": beside.get(row["gpu"])} for row in document["compiled"]["gpus"]]


def listed_blocks(lines: Sequence[str], weights: Sequence[Sequence[float]]) -> list[Json]:
    """The lines of a listing in runs of one block each: `runs` a program run, None for what no block holds; `share` of
    the most that any block runs."""
    most = max((times for _, _, times in weights), default=0.0)
    blocks: list[Json] = []
    at = 0
    for first, last, times in sorted((int(first), int(last), times) for first, last, times in weights if last > first):
        if first > at:
            blocks.append({"first": at, "lines": lines[at:first], "runs": None, "share": 0.0})
        blocks.append(
            {"first": first, "lines": lines[first:last], "runs": times, "share": times / most if most else 0.0}
        )
        at = last
    return [*blocks, {"first": at, "lines": lines[at:], "runs": None, "share": 0.0}]


def _newest(session: Session) -> list[Json]:
    query = select(Result).where(Result.device == COMPILERS).order_by(Result.id.desc()).limit(SHOWN)
    return [row for result in session.scalars(query) for row in compiled_rows(session, result.document, result.job_id)]
