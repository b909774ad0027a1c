"""Stored jobs as the API shows them, and what is found by the id in a path."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from renderer.build.tree import SahCosts
from server.problems import Problem
from server.recommendations import ASKED
from server.store.models import Job, Json, Study
from server.study_axes import write_costs

MAX_ID = 2**31 - 1
"""The largest id that every database holds."""


def find_job(session: Session, job_id: str, *, for_update: bool = False) -> Job:
    """A job by the id in a path, its row locked if it will be changed; raise Problem 404 when there is none."""
    job = session.get(Job, int(job_id), with_for_update=for_update or None) if _is_id(job_id) else None
    if job is None:
        raise Problem(404, f"There is no job {job_id}.")
    return job


def find_study(session: Session, study_id: str) -> Study:
    """A study by the id in a path; raise Problem 404 when there is none."""
    study = session.get(Study, int(study_id)) if _is_id(study_id) else None
    if study is None:
        raise Problem(404, f"There is no study {study_id}.")
    return study


def job_view(job: Job) -> dict[str, Any]:
    """A job with its progress, its history and its result."""
    return {
        **job_line(job),
        "request": job.request,
        "slices": {"done": sum(part.state == "done" for part in job.slices), "total": len(job.slices)},
        "changes": [{"state": c.state, "reason": c.reason, "at": iso(c.at)} for c in job.changes],
        "result": job.result.document if job.result else None,
        "profile": job.result.document.get("profile") if job.result else None,
    }


def job_line(job: Job) -> dict[str, Any]:
    """A job in a list."""
    return {
        "id": job.id,
        "study": job.study_id,
        "scene": job.scene,
        "variant": job.label,
        "size": _size(job.request),
        "sah": _costs(job.request),
        "device": job.device,
        "priority": job.priority,
        "state": job.state,
        "reason": job.reason,
        "created_at": iso(job.created_at),
        "started_at": iso(job.started_at),
        "finished_at": iso(job.finished_at),
        "url": f"/api/v1/jobs/{job.id}",
        "page": f"/recommend/{job.id}" if ASKED in job.request else f"/jobs/{job.id}",
    }


def job_lines() -> Select[Job]:
    """A query for jobs with what `job_line` shows."""
    return select(Job)


def _size(request: Json) -> str | None:
    size = request.get("size")
    return size and "x".join(str(side) for side in size)


def _costs(request: Json) -> str | None:
    costs = request.get("costs")
    return costs and write_costs(SahCosts(**costs))


def _is_id(text: str) -> bool:
    return text.isascii() and text.isdigit() and 0 < int(text) <= MAX_ID


def iso(time: datetime | None) -> str | None:
    """A time as the API writes it; None for None."""
    return None if time is None else time.isoformat(timespec="milliseconds")
