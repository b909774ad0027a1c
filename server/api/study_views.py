"""Stored studies as the API shows them, each with its progress."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from renderer.variant import AXES, Variant
from server.api.views import iso, job_line, job_lines
from server.live.study_left import read_left
from server.live.time_left import write_left
from server.store.models import Job, Slice, Study
from server.store.states import OPEN, STATES

REQUEST_KEYS = {"costs": "sah", "size": "size", "specialise": "specialise"}
"""A stored request's keys that are axes of studies though not of variants, with the axes' names."""

Counts = dict[str, int]


class _Jobs(NamedTuple):
    """A study's jobs in one state: how many, and when the last of them ended."""

    number: int
    finished: datetime | None


def study_view(session: Session, study: Study) -> dict[str, Any]:
    """A study with its progress and its jobs."""
    [line] = study_lines(session, [study])
    jobs = session.scalars(job_lines().where(Job.study_id == study.id).order_by(Job.id))
    return line | {"jobs": [job_line(job) for job in jobs]}


def study_lines(session: Session, studies: Sequence[Study]) -> list[dict[str, Any]]:
    """Studies in a list, each with its progress: slices done, time left, jobs by state, what was left out and why."""
    ids = [study.id for study in studies]
    slices, jobs, rows = _slices_by_state(session, ids), _jobs_by_state(session, ids), _rows(session, ids)
    left = read_left(session, [number for number in ids if not jobs[number].keys().isdisjoint(OPEN)])
    return [_study_line(study, slices[study.id], jobs[study.id], rows[study.id], left) for study in studies]


def _study_line(
    study: Study, slices: Counts, jobs: Mapping[str, _Jobs], rows: str, left: Mapping[int | None, float | None]
) -> dict[str, Any]:
    by_state = {state: jobs[state].number if state in jobs else 0 for state in STATES}
    ended = [group.finished for group in jobs.values() if group.finished is not None]
    query = f"study={study.id}{rows}"
    running = any(by_state[state] for state in OPEN)
    left_s = left.get(study.id) if running else 0.0
    return {
        "id": study.id,
        "name": study.name,
        "state": "running" if running else "done",
        "created_at": iso(study.created_at),
        "finished_at": None if running else iso(max(ended, default=None)),
        "slices": {
            "done": slices.get("done", 0),
            "ended": slices.get("failed", 0) + slices.get("cancelled", 0),
            "total": sum(slices.values()),
        },
        "left_s": None if left_s is None else round(left_s),
        "left": write_left(left_s) if running else None,
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
    mine = Job.study_id.in_(studies)
    first = session.scalars(select(func.min(Job.id)).where(mine).group_by(Job.label))  # A label names a variant whole.
    asked = session.execute(select(Job.label, Job.request).where(Job.id.in_(first.all())))
    # A job may be older than an axis.
    variants = {label: Variant().as_dict() | request["variant"] for label, request in asked}
    settings = (Job.request[key].as_string() for key in REQUEST_KEYS)
    kinds: dict[int, list[Sequence[Any]]] = defaultdict(list)
    for owner, label, *others in session.execute(
        select(Job.study_id, Job.label, Job.device, *settings).where(mine).distinct()
    ):
        kinds[owner].append([*(variants[label][axis] for axis in AXES), *others])
    return {study: _rows_query(kinds[study]) for study in studies}


def _rows_query(kinds: Sequence[Sequence[Any]]) -> str:
    several = [len(set(values)) > 1 for values in zip(*kinds, strict=True)]
    names = (*AXES, "device", *REQUEST_KEYS.values())
    others = (
        [name for name, differs in zip(names, several, strict=True) if differs and name != "traversal"] if kinds else []
    )
    return f"&rows={','.join(['traversal', *others])}" if others else ""
