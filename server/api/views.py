"""Stored jobs and studies as the API shows them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session, defer

from renderer.variant import AXES
from server.problems import Problem
from server.store.models import Job, Slice, Study
from server.store.states import OPEN, STATES

MAX_ID = 2**31 - 1
"""The largest id that every database holds."""

Counts = dict[str, int]


class _Jobs(NamedTuple):
    """A study's jobs in one state: how many, and when the last of them ended."""

    number: int
    finished: datetime | None


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
        "profile": job.result.document.get("profile") if job.result else None,
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
    """A study with its progress and its jobs."""
    [line] = study_lines(session, [study])
    jobs = session.scalars(job_lines().where(Job.study_id == study.id).order_by(Job.id))
    return line | {"jobs": [job_line(job) for job in jobs]}


def study_lines(session: Session, studies: Sequence[Study]) -> list[dict[str, Any]]:
    """Studies in a list, each with its progress: slices done, jobs by state, what was left out and why."""
    ids = [study.id for study in studies]
    slices, jobs, rows = _slices_by_state(session, ids), _jobs_by_state(session, ids), _rows(session, ids)
    return [_study_line(study, slices[study.id], jobs[study.id], rows[study.id]) for study in studies]


def job_lines() -> Select[Job]:
    """A query for jobs with what `job_line` shows alone."""
    return select(Job).options(defer(Job.request))


def _study_line(study: Study, slices: Counts, jobs: Mapping[str, _Jobs], rows: str) -> dict[str, Any]:
    by_state = {state: jobs[state].number if state in jobs else 0 for state in STATES}
    ended = [group.finished for group in jobs.values() if group.finished is not None]
    query = f"study={study.id}{rows}"
    running = any(by_state[state] for state in OPEN)
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
        "jobs_total": sum(by_state.values()),
        "refused": study.refused,
        "url": f"/api/v1/studies/{study.id}",
        "results": f"/api/v1/compare?{query}",
        "page": f"/?{query}",
    }


def _slices_by_state(session: Session, studies: Sequence[int]) -> dict[int | None, Counts]:
    counted = select(Job.study_id, Slice.state, func.count()).join(Slice.job).where(Job.study_id.in_(studies))
    found: dict[int | None, Counts] = defaultdict(dict)
    for study, state, count in session.execute(counted.group_by(Job.study_id, Slice.state)):
        found[study][state] = count
    return found


def _jobs_by_state(session: Session, studies: Sequence[int]) -> dict[int | None, dict[str, _Jobs]]:
    counted = select(Job.study_id, Job.state, func.count(), func.max(Job.finished_at)).where(Job.study_id.in_(studies))
    found: dict[int | None, dict[str, _Jobs]] = defaultdict(dict)
    for study, state, count, finished in session.execute(counted.group_by(Job.study_id, Job.state)):
        found[study][state] = _Jobs(count, finished)
    return found


def _rows(session: Session, studies: Sequence[int]) -> dict[int, str]:
    """The rows that tell each study's results apart: traversal, and every other axis on which its jobs differ."""
    alike = select(Job.study_id, Job.label, Job.device, func.min(Job.id))
    kinds = session.execute(alike.where(Job.study_id.in_(studies)).group_by(Job.study_id, Job.label, Job.device)).all()
    variants: dict[str, dict[str, str]] = {}
    found = {}
    first = {label: number for _, label, _, number in kinds}  # A label names its variant whole.
    for label, asked in session.execute(select(Job.label, Job.request).where(Job.id.in_(first.values()))):
        variants[label] = asked["variant"]
    for study in studies:
        own = [(variants[label], device) for owner, label, device, _ in kinds if owner == study]
        others = [axis for axis in AXES if len({variant[axis] for variant, _ in own}) > 1 and axis != "traversal"]
        others += ["device"] * (len({device for _, device in own}) > 1)
        found[study] = f"&rows={','.join(['traversal', *others])}" if others else ""
    return found


def _is_id(text: str) -> bool:
    return text.isascii() and text.isdigit() and 0 < int(text) <= MAX_ID


def _iso(time: datetime | None) -> str | None:
    return None if time is None else time.isoformat(timespec="milliseconds")
