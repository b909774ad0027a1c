"""GET /api/v1/jobs/{id}/trace and /studies/{id}/trace: a life to be looked at in Perfetto's interface."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response
from sqlalchemy import select

from server.api.state import database_of
from server.api.views import find_job, find_study, job_lines
from server.series.trace import job_trace, study_trace
from server.store.models import Change, Job, now

router = APIRouter(prefix="/api/v1")


@router.get("/jobs/{job_id}/trace")
def read_job_trace(job_id: str, request: Request) -> Response:
    """A job's life in Chrome's trace event format, times in microseconds from its first change: phases, slices, frames.

    `otherData.origin` is the time of zero. When a frame began is not recorded: frames are laid end to end.
    """
    with database_of(request).reading() as session:
        job = find_job(session, job_id)
        return _as_file(job_trace(job, now()), f"rayfarm-job-{job.id}")


@router.get("/studies/{study_id}/trace")
def read_study_trace(study_id: str, request: Request) -> Response:
    """A study's life in the same format: devices as processes, jobs as threads with their phases."""
    with database_of(request).reading() as session:
        study = find_study(session, study_id)
        jobs = session.scalars(job_lines().where(Job.study_id == study.id).order_by(Job.id)).all()
        found = session.scalars(
            select(Change)
            .join(Job, Job.id == Change.job_id)
            .where(Job.study_id == study.id)
            .order_by(Change.job_id, Change.id)
        )
        changes = {job_id: list(of_job) for job_id, of_job in groupby(found, key=lambda change: change.job_id)}
        lives = [(job, changes.get(job.id, [])) for job in jobs]
        return _as_file(study_trace(study.id, study.name, lives, now()), f"rayfarm-study-{study.id}")


def _as_file(trace: dict[str, Any], name: str) -> Response:
    return JSONResponse(trace, headers={"Content-Disposition": f'attachment; filename="{name}-trace.json"'})
