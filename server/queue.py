"""The queue of slices, on the store's own tables.

The seam for a durable queue: whoever replaces this module keeps the functions and their promises. A slice is held by
one worker at a time; only the holder's outcome is accepted; a job's slices are all handed out, or the job has ended.
"""

from __future__ import annotations

import os
import socket
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, cast

from sqlalchemy import CursorResult, exists, select, update
from sqlalchemy.orm import Session

from server.store.database import Database
from server.store.models import Job, Json, Slice, now
from server.store.records import add_result, change_state
from server.store.states import OPEN

MAX_ATTEMPTS = 3
"""A slice that loses its worker this often ends its job."""


@dataclass(frozen=True)
class Claim:
    """A slice that a worker holds; `request` is the job's, as JSON."""

    slice_id: int
    job_id: int
    round: int
    request: Json


@dataclass(frozen=True)
class Measured:
    """A job whose slices are all in: their measurements in the order of rounds."""

    job_id: int
    request: Json
    measurements: list[dict[str, Any]]


def claim_slice(database: Database, worker: str) -> Claim | None:
    """Hand the next queued slice to `worker`, or None when there is none.

    The order is (study, round, job): a study's configurations are interleaved in rounds (DESIGN.md, Timing).
    """
    with database.writing() as session:
        slice_ = session.scalar(
            select(Slice)
            .join(Job)
            .where(Slice.state == "queued", Job.state.in_(OPEN))
            .order_by(Job.created_at, Slice.round, Job.id)
            .limit(1)
            .with_for_update(skip_locked=True, of=Slice)
        )
        if slice_ is None:
            return None
        slice_.state, slice_.worker, slice_.beat_at = "running", worker, now()
        slice_.attempts += 1
        job = slice_.job
        if job.state == "queued":
            job.started_at = now()
            change_state(session, job, "running")
        return Claim(slice_.id, job.id, slice_.round, job.request)


def beat(database: Database, claim: Claim, worker: str) -> None:
    """Note that `worker` still works on its slice."""
    with database.writing() as session:
        _update_held(session, claim, worker, beat_at=now())


def finish_slice(database: Database, claim: Claim, worker: str, measurement: dict[str, Any]) -> bool:
    """Record a slice's measurement; False when the slice is no longer held by `worker`."""
    with database.writing() as session:
        return _update_held(session, claim, worker, state="done", measurement=measurement, beat_at=None)


def release_slice(database: Database, claim: Claim, worker: str) -> None:
    """Put an unfinished slice back, as a worker does that is told to stop; the attempt does not count."""
    with database.writing() as session:
        _update_held(session, claim, worker, state="queued", beat_at=None, attempts=Slice.attempts - 1)


def fail_slice(database: Database, claim: Claim, worker: str, reason: str) -> bool:
    """End the slice's job as failed, with a reason; False when the slice is no longer held by `worker`."""
    with database.writing() as session:
        if not _update_held(session, claim, worker, state="failed", beat_at=None):
            return False
        end_job(session, session.get_one(Job, claim.job_id), "failed", reason)
        return True


def measured_jobs(database: Database) -> list[Measured]:
    """The running jobs whose slices are all done and that have no result yet."""
    unfinished = exists().where(Slice.job_id == Job.id, Slice.state != "done")
    with database.reading() as session:
        jobs = session.scalars(select(Job).where(Job.state == "running", ~unfinished).order_by(Job.id)).all()
        return [Measured(job.id, job.request, [cast(Json, part.measurement) for part in job.slices]) for job in jobs]


def finish_job(database: Database, job_id: int, document: dict[str, Any]) -> None:
    """Record a job's result, once."""
    with database.writing() as session:
        job = session.get_one(Job, job_id, with_for_update=True)
        if job.state == "running":
            add_result(session, job, document)
            job.finished_at = now()
            change_state(session, job, "done")


def fail_job(database: Database, job_id: int, reason: str) -> None:
    """End a job as failed, with a reason."""
    with database.writing() as session:
        end_job(session, session.get_one(Job, job_id, with_for_update=True), "failed", reason)


def requeue_lost(database: Database, lease_s: float) -> int:
    """Put back the slices whose workers are gone; return how many.

    A worker is gone when it gave no sign of life for `lease_s` seconds, or at once when its process on this host is.
    """
    with database.writing() as session:
        running = session.scalars(select(Slice).where(Slice.state == "running").with_for_update()).all()
        expired = now() - timedelta(seconds=lease_s)
        lost = [s for s in running if s.beat_at is None or s.beat_at < expired or _is_dead_here(s.worker)]
        for slice_ in lost:
            _requeue(session, slice_)
        return len(lost)


def end_job(session: Session, job: Job, state: str, reason: str | None) -> None:
    """End an open job as failed or cancelled; its queued slices are cancelled."""
    if job.state not in OPEN:
        return
    session.execute(update(Slice).where(Slice.job_id == job.id, Slice.state == "queued").values(state="cancelled"))
    job.finished_at = now()
    change_state(session, job, "failed" if state == "failed" else "cancelled", reason)


def worker_name(token: str) -> str:
    """A name for this process's worker that `requeue_lost` understands; `token` tells reused process ids apart."""
    return f"{socket.gethostname()}:{os.getpid()}:{token}"


def _update_held(session: Session, claim: Claim, worker: str, **values: Any) -> bool:
    held = update(Slice).where(Slice.id == claim.slice_id, Slice.worker == worker, Slice.state == "running")
    result = cast(CursorResult[Any], session.execute(held.values(**values)))
    return result.rowcount == 1


def _requeue(session: Session, slice_: Slice) -> None:
    if slice_.attempts >= MAX_ATTEMPTS:
        slice_.state = "failed"
        reason = f"Round {slice_.round + 1} lost its worker {slice_.attempts} times."
        end_job(session, slice_.job, "failed", reason)
    else:
        slice_.state = "queued"
    slice_.worker = slice_.beat_at = None


def _is_dead_here(worker: str | None) -> bool:
    """Whether the named worker was a process of this host that has ended."""
    host, pid, _ = (worker or "::").rsplit(":", 2)
    if host != socket.gethostname() or not pid.isdigit():
        return False
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False
