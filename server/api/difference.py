"""GET /api/v1/difference and /results: two sides compared, and one side's results."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from sqlalchemy import select

from renderer.variant import AXES
from server.api.state import database_of
from server.comparison.differences import CLOCKS, DEFAULT_GATE, differences_view, find_differences
from server.comparison.sides import Side, SideError, choose, compared_names, read_side
from server.problems import Problem
from server.store.database import Database
from server.store.models import Job, Result, Study

MAX_RESULTS = 2000
COLUMNS = ("scene", "device", *AXES)

router = APIRouter(prefix="/api/v1")
SideText = Annotated[str, Query(max_length=1000)]


@router.get("/difference")
def read_difference(
    request: Request,
    baseline: SideText,
    against: SideText,
    gate: float = Query(DEFAULT_GATE * 100, ge=0, le=1000, description="per cent"),
    clock: str = "auto",
) -> dict[str, Any]:
    """How much slower `against` is than `baseline`: each `job:1`, `study:2` or a selection as `scene=forest`.

    Pairs share all axes, the scene, the device and the size, except what both sides choose by.
    """
    if clock not in CLOCKS:
        raise SideError(f"Unknown clock {clock!r}: choose one of {', '.join(CLOCKS)}.")
    first, second = _stored(baseline), _stored(against)
    database = database_of(request)
    found = find_differences(load(database, first), load(database, second), compared_names(first, second), clock)
    return differences_view(found, gate / 100)


@router.get("/results")
def read_documents(request: Request, of: SideText) -> dict[str, Any]:
    """The results of one side, the oldest first, raw frames and all; of a selection the latest 2000 at most."""
    return {"results": load(database_of(request), _stored(of))}


def load(database: Database, side: Side) -> list[dict[str, Any]]:
    """A side's stored results, the oldest first; raise Problem 404 or SideError when there is none."""
    query = select(Result.document).join(Job).order_by(Result.id.desc()).limit(MAX_RESULTS)
    for name, value in side.filters.items():
        if name in COLUMNS:
            query = query.where(getattr(Result, name) == value)
    with database.reading() as session:
        if side.kind != "all":
            kind, column = (Job, Job.id) if side.kind == "job" else (Study, Job.study_id)
            if session.get(kind, side.number) is None:
                raise Problem(404, f"There is no {side.kind} {side.number}.")
            query = query.where(column == side.number)
        return choose(side, reversed(session.scalars(query).all()))


def _stored(text: str) -> Side:
    side = read_side(text)
    if side.kind == "file":
        raise SideError(f"{text[:200]!r} is not stored here: write job:12, study:3 or a selection as scene=forest.")
    return side
