"""One job."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from server.api.state import database_of
from server.api.views import find_job, job_view
from server.dashboard.fields import result_fields
from server.dashboard.templates import render
from server.store.states import OPEN

router = APIRouter(include_in_schema=False)


@router.get("/jobs/{job_id}")
def job_page(job_id: str, request: Request) -> Response:
    """One job: state, history, result."""
    with database_of(request).reading() as session:
        found = find_job(session, job_id)
        job, after = job_view(found), max((change.id for change in found.changes), default=0)
    fields = result_fields(job["result"]) if job["result"] else []
    return render(request, "job.html", {"job": job, "fields": fields, "after": after, "open_states": OPEN})
