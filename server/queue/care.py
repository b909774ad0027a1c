"""What every process of the farm does now and then, so that any of them may die."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import select

from server.devices import registry
from server.queue import dispatch, lives
from server.queue.durable import Durable
from server.store.database import Database
from server.store.models import Device

log = logging.getLogger("rayfarm.care")

CARE_S = 2.0


def look_after(database: Database, durable: Durable, lease_s: float) -> None:
    """Hand on what the dead held, show the devices of hosts without a worker as away, send slices where they belong."""
    lives.reap_dead(database, durable, lease_s)
    _miss_hosts(database, lease_s)
    dispatch.settle(database, durable)


def _miss_hosts(database: Database, lease_s: float) -> None:
    shown = select(Device.host).where(Device.presence != "offline", Device.host.is_not(None)).distinct()
    with database.reading() as session:
        missed = set(session.scalars(shown)) - registry.live_hosts(session, lease_s)
    for host in sorted(str(name) for name in missed):
        with database.writing() as session:
            registry.host_gone(session, host)


@contextmanager
def caring(database: Database, durable: Durable, lease_s: float) -> Iterator[None]:
    """Look after the farm in a thread, to the end of the block."""
    ended = threading.Event()

    def run() -> None:
        while not ended.wait(min(CARE_S, lease_s / 10)):
            try:
                look_after(database, durable, lease_s)
            except Exception:
                log.exception("looking after the farm failed; it is tried again")

    thread = threading.Thread(target=run, name="care", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
