"""GET /api/v1/difference and /results: two sides compared, and one side's results."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from sqlalchemy import select

from server.api.state import database_of
from server.comparison.differences import CLOCKS, DEFAULT_GATE, differences_view, find_differences
from server.comparison.filters import selected
from server.comparison.sides import Side, SideError, choose, compared_names, read_side
from server.comparison.stored_alarms import latest_alarms
from server.problems import Problem
from server.store.database import Database
from server.store.models import Job, Result, Study

MAX_RESULTS = 2000

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
    first, second = stored_side(baseline), stored_side(against)
    database = database_of(request)
    found = find_differences(load(database, first), load(database, second), compared_names(first, second), clock)
    return differences_view(found, gate / 100)


@router.get("/results")
def read_documents(request: Request, of: SideText) -> dict[str, Any]:
    """The results of one side, the oldest first, raw frames and all; of a selection the latest 2000 at most."""
    return {"results": load(database_of(request), stored_side(of))}


def load(database: Database, side: Side) -> list[dict[str, Any]]:
    """A side's stored results, the oldest first; raise Problem 404 or SideError when there is none."""
    wanted = selected({name: (value,) for name, value in side.filters.items()}, None)
    query = select(Result.document).join(Job).where(*wanted).order_by(Result.id.desc()).limit(MAX_RESULTS)
    with database.reading() as session:
        if side.kind != "all":
            kind, column = (Job, Job.id) if side.kind == "job" else (Study, Job.study_id)
            if session.get(kind, side.number) is None:
                raise Problem(404, f"There is no {side.kind} {side.number}.")
            query = query.where(column == side.number)
        return choose(side, reversed(session.scalars(query).all()))


@router.get("/false-alarms")
def read_alarms(request: Request) -> dict[str, Any]:
    """Of each device its latest study `aa`: how often it called equal things different, and what it can see."""
    with database_of(request).reading() as session:
        found = latest_alarms(session)
    return {"devices": [{"study": number, **asdict(alarms)} for number, alarms in found]}


def stored_side(text: str) -> Side:
    """A side that this service can have; raise SideError for a file or what is not understood."""
    side = read_side(text)
    if side.kind == "file":
        raise SideError(f"{text[:200]!r} is not stored here: write job:12, study:3 or a selection as scene=forest.")
    return side
