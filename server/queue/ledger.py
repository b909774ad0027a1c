"""Slices in the hands of workers: claimed, followed through their phases, recorded once. Each step is one transaction.

Whoever changes a slice holds its job's row lock first, so that no two of them can wait for each other. An outcome
counts only if the slice is still held under the attempt number that its claim got: whoever was taken for dead and
wakes up can change nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import CursorResult, select, update
from sqlalchemy.orm import Session

from server.queue.dispatch import put_slices, show_if_waiting
from server.queue.durable import Durable
from server.store.database import Database
from server.store.models import Job, Json, Slice, now
from server.store.records import add_result, change_state
from server.store.states import HELD, OPEN, State

MAX_ATTEMPTS = 20
"""A slice that loses its device or its worker this often ends its job."""
BACK_OFF_S = 2.0
MAX_BACK_OFF_S = 60.0

Combine = Callable[[list[Json]], Json | None]
"""A job's result from the measurements of all its rounds; None where they are no result to compare."""


@dataclass(frozen=True)
class Claim:
    """A slice that a worker holds; `request` is the job's, as JSON, and `attempt` the number that fences it."""

    slice_id: int
    job_id: int
    round: int
    rounds: int
    attempt: int
    worker: str
    device: str
    request: Json


def claim(database: Database, slice_id: int, workflow: str, worker: str) -> Claim | None:
    """Hand a slice to `worker` for the workflow that it was last put as; None when that is no longer wanted."""
    with database.writing() as session:
        job = lock_job_of(session, slice_id)
        part = session.get(Slice, slice_id)
        if job is None or job.state not in OPEN or part is None:
            return None
        if part.workflow != workflow or part.state not in ("queued", *HELD):
            return None
        part.state, part.worker = "preparing", worker
        part.started_at, part.ended_at = now(), None
        part.attempts += 1
        job.started_at = job.started_at or now()
        rounds = len(job.slices)
        claimed = Claim(part.id, job.id, part.round, rounds, part.attempts, worker, job.device, job.request)
        change_state(session, job, "preparing", _reason(claimed))
        return claimed


def enter(database: Database, held: Claim, phase: State) -> bool:
    """Note the phase that a slice is in; False when it is no longer held.

    A slice that waits for a lock stays in the state that it was in: it is its worker's.
    """
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        if not _update_held(session, held, **({"state": phase} if phase in HELD else {"worker": held.worker})):
            return False
        if job.state in OPEN and job.state != phase:
            change_state(session, job, phase, _reason(held))
        return True


def note(database: Database, held: Claim, text: str) -> None:
    """Note in a job's history what is done just now."""
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        part = session.get_one(Slice, held.slice_id)
        if job.state in HELD and part.worker == held.worker and part.attempts == held.attempt:
            change_state(session, job, job.state, text)


def record(database: Database, held: Claim, measurement: Json, combine: Combine) -> bool:
    """Record a slice's measurement, and with the last one the job's result; False when it is no longer held."""
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        if not _update_held(session, held, state="done", measurement=measurement, ended_at=now()):
            return False
        if job.state not in OPEN:
            return True
        if all(part.state == "done" for part in job.slices):
            parts = session.scalars(select(Slice.measurement).where(Slice.job_id == job.id).order_by(Slice.round))
            document = combine([cast(Json, part) for part in parts])
            if document is not None:
                add_result(session, job, document)
            job.finished_at = now()
            change_state(session, job, "done")
        elif not show_if_waiting(session, job):
            done = sum(part.state == "done" for part in job.slices)
            change_state(session, job, "queued", f"{done} of {len(job.slices)} rounds are done.")
        return True


def fail(database: Database, durable: Durable, held: Claim, reason: str) -> bool:
    """End the slice's job as failed, with a reason; False when the slice is no longer held."""
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        if not _update_held(session, held, state="failed", worker=None, ended_at=now()):
            return False
        void = end_job(session, job, "failed", reason)
    durable.cancel(void)
    return True


def give_back(database: Database, durable: Durable, held: Claim, reason: str) -> bool:
    """Put back a slice whose device went away: it waits for the device, or comes again after a pause."""
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        if job.state not in OPEN:
            return _update_held(session, held, state="cancelled", worker=None, ended_at=now())
        if not _update_held(session, held, state="queued", worker=None):
            return False
        part = session.get_one(Slice, held.slice_id)
        if part.attempts < MAX_ATTEMPTS:
            change_state(session, job, "queued", f"{reason} Attempt {part.attempts + 1} follows.")
            pause = min(MAX_BACK_OFF_S, BACK_OFF_S * 2 ** (part.attempts - 1))
            put_slices(session, durable, [part], delay_s=pause)
            return True
        part.state, part.ended_at = "failed", now()
        void = end_job(session, job, "failed", f"{reason} That was attempt {part.attempts}, the last.")
    durable.cancel(void)
    return True


def let_go(database: Database, held: Claim) -> None:
    """Let go of a slice whose run was interrupted: cancelled with its job, else left to whoever hands it on."""
    with database.writing() as session:
        job = session.get_one(Job, held.job_id, with_for_update=True)
        if job.state not in OPEN:
            _update_held(session, held, state="cancelled", worker=None, ended_at=now())


def lose(session: Session, slice_ids: Sequence[int], worker: str, reason: str) -> list[str]:
    """Take the slices that a worker held out of its hands; return the workflows of jobs that end by it."""
    void: list[str] = []
    for slice_id in slice_ids:
        job = lock_job_of(session, slice_id)
        part = session.get(Slice, slice_id)
        if job is None or part is None or part.worker != worker or part.state not in HELD:
            continue
        part.worker = None
        if job.state not in OPEN:
            part.state, part.ended_at = "cancelled", now()
        elif part.attempts >= MAX_ATTEMPTS:
            part.state, part.ended_at = "failed", now()
            void += end_job(session, job, "failed", f"{reason} That was attempt {part.attempts}, the last.")
        else:
            part.state = "queued"
            change_state(session, job, "queued", f"{reason} Attempt {part.attempts + 1} follows.")
    return void


def end_job(session: Session, job: Job, state: State, reason: str | None) -> list[str]:
    """End an open job as failed or cancelled; return its workflows, to be cancelled once that is committed.

    A slice that a worker holds stays held until its child is gone.
    """
    if job.state not in OPEN:
        return []
    void = [part.workflow for part in job.slices if part.workflow and part.state in ("queued", "waiting", *HELD)]
    idle = update(Slice).where(Slice.job_id == job.id, Slice.state.in_(("queued", "waiting")))
    session.execute(idle.values(state="cancelled"))
    job.finished_at = now()
    change_state(session, job, state, reason)
    return void


def lock_job_of(session: Session, slice_id: int) -> Job | None:
    """A slice's job, its row locked."""
    of_slice = select(Job).join(Slice).where(Slice.id == slice_id)
    return session.scalar(of_slice.with_for_update(of=Job))


def _update_held(session: Session, held: Claim, **values: Any) -> bool:
    still = update(Slice).where(
        Slice.id == held.slice_id,
        Slice.attempts == held.attempt,
        Slice.worker == held.worker,
        Slice.state.in_(HELD),
    )
    result = cast(CursorResult[Any], session.execute(still.values(**values)))
    return result.rowcount == 1


def _reason(held: Claim) -> str:
    attempt = f", attempt {held.attempt}" if held.attempt > 1 else ""
    return f"Round {held.round + 1} of {held.rounds} on {held.device}{attempt}."
