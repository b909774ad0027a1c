"""Whether what should run does. Health checks are these, so each loads no more than it needs."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from typing import TYPE_CHECKING

from server.doctor.finding import Said
from server.settings import settings

if TYPE_CHECKING:
    from sqlalchemy import Engine

TIMEOUT_S = 5.0


def service() -> Iterator[Said]:
    """Whether the service at RAYFARM_SERVER is ready."""
    import httpx

    where = settings().server.rstrip("/")
    try:
        answer = httpx.get(f"{where}/readyz", timeout=TIMEOUT_S, trust_env=False)
    except (httpx.HTTPError, httpx.InvalidURL):
        yield "missing", f"No RayFarm service answers at {where}: start `rayfarm serve`, or correct RAYFARM_SERVER."
        return
    if answer.is_success:
        yield "good", f"The service at {where} is ready."
    else:
        yield "missing", f"The service at {where} is not ready ({answer.status_code}): see its log and its database."


def worker() -> Iterator[Said]:
    """Whether a worker of this machine gave a sign of life within its lease."""
    from server.doctor.opening import opened

    host, lease = settings().worker_host, timedelta(seconds=settings().lease_s)
    with opened() as (engine, (state, sentence)):
        if engine is None and state == "missing":
            yield state, sentence
        elif engine is not None and _lives(engine, host, lease):
            yield "good", f"A worker of {host} is alive."
        else:
            silent = f"No worker of {host} gave a sign of life for {lease.seconds} s"
            yield "missing", f"{silent}: start `rayfarm worker` there, and see its log."


def _lives(engine: Engine, host: str, lease: timedelta) -> bool:
    from sqlalchemy import inspect, select
    from sqlalchemy.orm import Session

    from server.store.models import Worker, now

    if not inspect(engine).has_table(Worker.__tablename__):
        return False
    alive = Worker.ended_at.is_(None), Worker.reaped_at.is_(None), Worker.beat_at > now() - lease
    with Session(engine) as session:
        return session.scalars(select(Worker.id).where(Worker.host == host, *alive).limit(1)).first() is not None
