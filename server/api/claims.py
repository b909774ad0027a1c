"""GET /api/v1/studies/{id}/claims: the paper's claims, judged on a study's results."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request

from server.api.difference import load
from server.api.state import database_of
from server.api.views import find_study
from server.comparison.sides import read_side
from server.problems import Problem
from server.store.database import Database
from server.store.models import Result

router = APIRouter(prefix="/api/v1")


@router.get("/studies/{study_id}/claims")
def read_claims(study_id: str, request: Request) -> dict[str, Any]:
    """Every claim with its verdict and the figures behind it, a device after the other."""
    from server.paper.judging import claims_view, judge

    _, documents = study_results(database_of(request), study_id)
    return {"study": int(study_id), **claims_view(judge(documents))}


def study_results(database: Database, study_id: str) -> tuple[str, list[dict[str, Any]]]:
    """A study's name and its results, the oldest first; raise Problem 404 where there is no study or no result."""
    with database.reading() as session:
        study = find_study(session, study_id)
        name, number = study.name, study.id
        measured = session.query(Result.id).filter(Result.study_id == number).first() is not None
    if not measured:
        raise Problem(404, f"Study {number} has no results yet: wait until a job is done.")
    return name, load(database, read_side(f"study:{number}"))
