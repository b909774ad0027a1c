"""Jobs and scenes."""

from __future__ import annotations

import logging
from typing import Any

from fastapi import APIRouter, Query, Request, Response

from server.api.bodies import JobBody
from server.api.idempotency import SubmissionOf
from server.api.intake import Sent, intake_of
from server.api.state import database_of, durable_of
from server.api.views import MAX_ID, find_job, job_line, job_lines, job_view
from server.logs import facts
from server.problems import Problem
from server.queue.ledger import end_job
from server.scene_list import list_scenes
from server.store.models import Job
from server.store.records import Order
from server.store.states import OPEN, State

log = logging.getLogger("rayfarm.api")

router = APIRouter(prefix="/api/v1")


@router.post("/jobs", status_code=201)
async def create_job(body: JobBody, request: Request, submission: SubmissionOf) -> Response:
    """Queue one variant on one scene."""
    order = Order(body.to_request(), body.device, body.priority)
    return await intake_of(request).take(Sent(submission, order))


@router.get("/jobs")
def list_jobs(
    request: Request,
    state: State | None = None,
    study: int | None = Query(None, ge=1, le=MAX_ID),
    scene: str | None = None,
    before: int | None = Query(None, ge=1, le=MAX_ID, description="only jobs with a smaller id"),
    limit: int = Query(100, ge=1, le=1000),
) -> dict[str, Any]:
    """Jobs, the newest first; `next` is the address of the next page or null."""
    wanted = {Job.state: state, Job.study_id: study, Job.scene: scene}
    query = job_lines().order_by(Job.id.desc()).limit(limit + 1)
    query = query.where(*(column == value for column, value in wanted.items() if value is not None))
    if before is not None:
        query = query.where(Job.id < before)
    with database_of(request).reading() as session:
        jobs = session.scalars(query).all()
        more = len(jobs) > limit
        url = request.url.include_query_params(before=jobs[limit - 1].id) if more else None
        return {"jobs": [job_line(job) for job in jobs[:limit]], "next": url and f"{url.path}?{url.query}"}


@router.get("/jobs/{job_id}")
def read_job(job_id: str, request: Request) -> dict[str, Any]:
    """One job with its state, its history and its result."""
    with database_of(request).reading() as session:
        return job_view(find_job(session, job_id))


@router.post("/jobs/{job_id}/cancel")
def cancel_job(job_id: str, request: Request) -> dict[str, Any]:
    """Cancel a queued or running job; what is being measured is ended within seconds."""
    with database_of(request).writing() as session:
        job = find_job(session, job_id, for_update=True)
        if job.state not in OPEN:
            raise Problem(409, f"Job {job_id} is {job.state}: only a queued or running job can be cancelled.")
        void = end_job(session, job, "cancelled", "Cancelled on request.")
        session.flush()
        session.expire(job)
        view = job_view(job)
    durable_of(request).cancel(void)
    log.info("job cancelled", extra=facts(job=view["id"]))
    return view


@router.get("/scenes")
def read_scenes() -> dict[str, Any]:
    """The catalogue."""
    return {"scenes": list_scenes()}
