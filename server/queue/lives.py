"""The lives of workers: signs of life, and the handing on of what a dead one held.

A worker is dead when it has given no sign of life for the lease, as `watch` times it, or at once when its process on
this machine is gone. It is given up by one of the living, in one update of its row; from then on it must end, whatever
it was doing. One that was frozen may take more before it learns of that: whatever the given-up hold is handed on again.
"""

from __future__ import annotations

import logging
import os
import socket
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, cast

from sqlalchemy import CursorResult, delete, or_, select, update

from server.logs import facts
from server.queue.durable import Durable
from server.queue.ledger import lose
from server.queue.watch import Watch
from server.store.database import Database
from server.store.models import Slice, Worker, now
from server.store.states import HELD

log = logging.getLogger("rayfarm.care")

HANDING_ON_S = 30.0
"""Whoever gives a worker up has this long to hand its work on before another may try."""


def worker_id(token: str) -> str:
    """A name for this process's worker that `is_dead_here` understands; `token` tells reused process ids apart."""
    return f"{_here()}:{os.getpid()}:{token}"


def begin(database: Database, worker: str, host: str) -> None:
    """Register a worker."""
    with database.writing() as session:
        session.add(Worker(id=worker, host=host))


def beat(database: Database, worker: str) -> bool:
    """Give a sign of life; False when the worker has been given up and must end."""
    with database.writing() as session:
        alive = update(Worker).where(Worker.id == worker, Worker.reaped_at.is_(None), Worker.ended_at.is_(None))
        return cast(CursorResult[Any], session.execute(alive.values(beat_at=now()))).rowcount == 1


def end(database: Database, durable: Durable, worker: str) -> None:
    """Note that a worker has ended by itself, and hand on what it held."""
    with database.writing() as session:
        session.execute(update(Worker).where(Worker.id == worker).values(ended_at=now()))
    reap(database, durable, worker, "Its worker was stopped.")


def reap_dead(database: Database, durable: Durable, watch: Watch) -> int:
    """Hand on the work of dead workers; return how many were given up."""
    takers = durable.takers()
    with database.reading() as session:
        known = session.execute(select(Worker.id, Worker.beat_at).where(Worker.reaped_at.is_(None))).all()
        tried = now() - timedelta(seconds=HANDING_ON_S)
        unfinished = session.scalars(
            select(Worker.id).where(Worker.reaped_at < tried, Worker.handed_on_at.is_(None))
        ).all()
        holding = select(Slice.worker).where(Slice.state.in_(HELD))
        busy = Worker.id.in_(holding) | Worker.id.in_(takers)
        woken = session.scalars(select(Worker.id).where(Worker.handed_on_at.is_not(None), busy)).all()
    silent = watch.silent([(worker, beat_at) for worker, beat_at in known])
    dead = [worker for worker, _ in known if worker in silent or is_dead_here(worker)]
    return sum(reap(database, durable, worker, "Its worker was lost.") for worker in [*dead, *unfinished, *woken])


def reap(database: Database, durable: Durable, worker: str, reason: str) -> bool:
    """Give one worker up and hand on what it held; False when somebody else does."""
    tried = now() - timedelta(seconds=HANDING_ON_S)
    with database.writing() as session:
        nobodys = or_(Worker.reaped_at.is_(None), Worker.handed_on_at.is_not(None), Worker.reaped_at < tried)
        mine = update(Worker).where(Worker.id == worker, nobodys)
        if cast(CursorResult[Any], session.execute(mine.values(reaped_at=now(), handed_on_at=None))).rowcount == 0:
            return False
        held = session.scalars(select(Slice.id).where(Slice.worker == worker, Slice.state.in_(HELD))).all()
        void = lose(session, held, worker, reason)
    log.warning("what a worker held is handed on: %s", reason, extra=facts(worker=worker, slices=list(held) or None))
    durable.cancel(void)
    # What it had taken from the queue but not yet claimed is known to the queue alone.
    for workflow, queue in durable.held_by(worker):
        if queue is not None:
            durable.resume(workflow, queue)
    with database.writing() as session:
        session.execute(update(Worker).where(Worker.id == worker).values(handed_on_at=now()))
    return True


def forget_before(database: Database, time: datetime) -> None:
    """Delete workers whose work was handed on before a time."""
    with database.writing() as session:
        session.execute(delete(Worker).where(Worker.handed_on_at < time))


def is_dead_here(worker: str) -> bool:
    """Whether the named worker was a process of this machine that has ended."""
    here, pid, _ = worker.rsplit(":", 2)
    if here != _here() or not pid.isdigit():
        return False
    try:
        os.kill(int(pid), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False


def _here() -> str:
    """This machine, and in it the process ids' namespace: containers may share a name."""
    try:
        namespace = Path("/proc/self/ns/pid").stat().st_ino
    except OSError:
        namespace = 0
    return f"{socket.gethostname()}/{namespace}"
