"""Writing jobs, studies, results and changes of state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from sqlalchemy.orm import Session

from renderer.request import Request
from renderer.variant import AXES
from server.store.models import Change, Job, Result, Slice, Study, now
from server.store.states import State


def add_job(session: Session, request: Request) -> Job:
    """Queue one job."""
    return _add_jobs(session, [request], None)[0]


def add_study(
    session: Session, name: str, body: dict[str, Any], requests: Sequence[Request], refused: list[dict[str, Any]]
) -> Study:
    """Queue a study's jobs; `refused` is what was left out, with reasons."""
    study = Study(name=name, request=body, refused=refused)
    session.add(study)
    session.flush()
    _add_jobs(session, requests, study.id)
    return study


def change_state(session: Session, job: Job, state: State, reason: str | None = None) -> None:
    """Set a job's state and note when and why."""
    job.state, job.reason = state, reason
    session.add(Change(job_id=job.id, state=state, reason=reason))


def add_result(session: Session, job: Job, document: dict[str, Any]) -> Result:
    """Record a job's result; figures that are no numbers (NaN, infinity) were not measured and become null."""
    clean = without_nan(document)
    device = clean.get("device") or {}
    axes = {axis: str(clean.get(axis)) for axis in AXES}
    result = Result(job_id=job.id, scene=str(clean["scene"]), device=str(device.get("id")), document=clean, **axes)
    session.add(result)
    return result


def without_nan(value: Any) -> Any:
    """The same JSON with null for every float that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _add_jobs(session: Session, requests: Sequence[Request], study_id: int | None) -> list[Job]:
    created_at = now()
    jobs = [
        Job(
            study_id=study_id,
            scene=request.scene,
            label=request.variant.label,
            request=request.to_json(),
            state="queued",
            created_at=created_at,
            slices=[Slice(round=index) for index in range(request.rounds)],
        )
        for request in requests
    ]
    session.add_all(jobs)
    session.flush()
    for job in jobs:
        session.add(Change(job_id=job.id, state="queued", at=created_at))
    return jobs
