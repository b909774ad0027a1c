"""Stored jobs and studies as the API shows them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from renderer.variant import AXES
from server.problems import Problem
from server.store.models import Job, Slice, Study
from server.store.states import OPEN, STATES

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
        "changes": [{"state": c.state, "reason": c.reason, "at": _iso(c.at)} for c in job.changes],
        "result": job.result.document if job.result else None,
    }


def job_line(job: Job) -> dict[str, Any]:
    """A job in a list."""
    return {
        "id": job.id,
        "study": job.study_id,
        "scene": job.scene,
        "variant": job.label,
        "device": job.device,
        "priority": job.priority,
        "state": job.state,
        "reason": job.reason,
        "created_at": _iso(job.created_at),
        "started_at": _iso(job.started_at),
        "finished_at": _iso(job.finished_at),
        "url": f"/api/v1/jobs/{job.id}",
        "page": f"/jobs/{job.id}",
    }


def study_view(session: Session, study: Study) -> dict[str, Any]:
    """A study with its progress: slices done, jobs by state, what was left out and why."""
    jobs = session.scalars(select(Job).where(Job.study_id == study.id).order_by(Job.id)).all()
    by_state = {state: sum(job.state == state for job in jobs) for state in STATES}
    slices = _slices_by_state(session, study)
    ended = [job.finished_at for job in jobs if job.finished_at is not None]
    query = f"study={study.id}{_rows(jobs)}"
    running = any(job.state in OPEN for job in jobs)
    return {
        "id": study.id,
        "name": study.name,
        "state": "running" if running else "done",
        "created_at": _iso(study.created_at),
        "finished_at": None if running else _iso(max(ended, default=None)),
        "slices": {
            "done": slices.get("done", 0),
            "ended": slices.get("failed", 0) + slices.get("cancelled", 0),
            "total": sum(slices.values()),
        },
        "jobs_by_state": by_state,
        "jobs": [job_line(job) for job in jobs],
        "refused": study.refused,
        "url": f"/api/v1/studies/{study.id}",
        "results": f"/api/v1/compare?{query}",
        "page": f"/?{query}",
    }


def _slices_by_state(session: Session, study: Study) -> dict[str, int]:
    counted = select(Slice.state, func.count()).join(Job).where(Job.study_id == study.id).group_by(Slice.state)
    return dict(session.execute(counted).all())


def _rows(jobs: Sequence[Job]) -> str:
    """The rows that tell a study's results apart: traversal, and every other axis on which its jobs differ."""
    others = [axis for axis in AXES if len({job.request["variant"][axis] for job in jobs}) > 1 and axis != "traversal"]
    others += ["device"] * (len({job.device for job in jobs}) > 1)
    return f"&rows={','.join(['traversal', *others])}" if others else ""


def _is_id(text: str) -> bool:
    return text.isascii() and text.isdigit() and 0 < int(text) <= MAX_ID


def _iso(time: datetime | None) -> str | None:
    return None if time is None else time.isoformat(timespec="milliseconds")
