"""Writing jobs, studies, results and changes of state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from renderer.request import Request
from renderer.variant import AXES
from server.store.defaults import LLVMPIPE, NORMAL_PRIORITY
from server.store.models import Change, Job, Result, Slice, Study, now
from server.store.setups import facts_of, require_setup
from server.store.states import State


@dataclass(frozen=True)
class Order:
    """What is asked for, of which device, and how urgently."""

    request: Request
    device: str = LLVMPIPE
    priority: int = NORMAL_PRIORITY


def add_study(session: Session, name: str, body: dict[str, Any], refused: list[dict[str, Any]]) -> Study:
    """Add a study; `refused` is what was left out of it, with reasons."""
    study = Study(name=name, request=body, refused=refused)
    session.add(study)
    session.flush()
    return study


def add_jobs(session: Session, orders: Sequence[Order], *, study_id: int | None = None) -> list[Slice]:
    """Add jobs and return their slices in the order in which they should run: all jobs' first rounds, then the second.

    A study's configurations are interleaved in rounds, so that drift hits all alike (docs/method.md, Time).
    """
    jobs = [_add_job(session, order, study_id) for order in orders]
    rounds = max((order.request.rounds for order in orders), default=0)
    slices = [
        Slice(job=job, round=index)
        for index in range(rounds)
        for job, order in zip(jobs, orders, strict=True)
        if index < order.request.rounds
    ]
    session.add_all(slices)
    session.flush()
    return slices


def add_single(
    session: Session, scene: str, label: str, request: dict[str, Any], device: str, priority: int
) -> list[Slice]:
    """Add a job of one slice that is no variant's measurement, and return the slice."""
    job = Job(scene=scene, label=label, request=request, device=device, priority=priority, created_at=now())
    session.add(job)
    session.flush()
    session.add(Change(job_id=job.id, state="queued", at=job.created_at))
    part = Slice(job=job, round=0)
    session.add(part)
    session.flush()
    return [part]


def change_state(session: Session, job: Job, state: State, reason: str | None = None) -> None:
    """Set a job's state and note when and why."""
    job.state, job.reason = state, reason
    session.add(Change(job_id=job.id, state=state, reason=reason))


def add_result(session: Session, job: Job, document: dict[str, Any]) -> Result:
    """Record a job's result; figures that are no numbers (NaN, infinity) were not measured and become null."""
    clean = without_nan(document)
    setup = require_setup(session, facts_of(clean))
    result = Result(job_id=job.id, study_id=job.study_id, setup_id=setup, **result_columns(clean))
    session.add(result)
    return result


def result_columns(document: dict[str, Any]) -> dict[str, Any]:
    """The document and the columns that are copied from it."""
    device = document.get("device") or {}
    axes = {axis: str(document.get(axis)) for axis in AXES}
    return {"scene": str(document["scene"]), "device": str(device.get("id")), "document": document, **axes}


def without_nan(value: Any) -> Any:
    """The same JSON with null for every float that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _add_job(session: Session, order: Order, study_id: int | None) -> Job:
    job = Job(
        study_id=study_id,
        scene=order.request.scene,
        label=order.request.variant.label,
        request=order.request.to_json(),
        device=order.device,
        priority=order.priority,
        created_at=now(),
        result=None,
    )
    job.changes.append(Change(state="queued", at=job.created_at))
    session.add(job)
    return job
