"""The latest studies, and one study."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select

from server.api.events import feed_of
from server.api.state import database_of
from server.api.views import find_study, job_line, job_lines, study_lines, study_view
from server.dashboard.templates import render
from server.store.models import Job, Study
from server.store.states import OPEN

router = APIRouter(include_in_schema=False)
SHOWN = 50


@router.get("/studies")
def studiesrender(request: Request) -> Response:
    """The latest studies, and the latest jobs."""
    with database_of(request).reading() as session:
        studies = session.scalars(select(Study).order_by(Study.id.desc()).limit(SHOWN)).all()
        jobs = session.scalars(job_lines().order_by(Job.id.desc()).limit(SHOWN)).all()
        context = {"studies": study_lines(session, studies), "jobs": [job_line(job) for job in jobs]}
    return render(request, "studies.html", context)


@router.get("/studies/{study_id}")
def study_page(study_id: str, request: Request) -> Response:
    """One study and its progress."""
    after = feed_of(request).settled()  # Asked first: what the page does not show then comes as an event.
    with database_of(request).reading() as session:
        study = study_view(session, find_study(session, study_id))
    return render(request, "study.html", {"study": study, "after": after, "open_states": OPEN})
