"""What every process of the farm does now and then, so that any of them may die."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

from sqlalchemy import select

from server.devices import registry
from server.queue import dispatch, lives
from server.queue.durable import Durable
from server.queue.trouble import Trouble
from server.queue.watch import Watch
from server.store.database import Database
from server.store.errors import AWAY
from server.store.models import Device, now

log = logging.getLogger("rayfarm.care")

CARE_S = 2.0
TIDY_S = 3600.0
KEPT = timedelta(days=7)


def look_after(database: Database, durable: Durable, watch: Watch) -> None:
    """Hand on what the dead held, show the devices of hosts without a worker as away, send slices where they belong."""
    lives.reap_dead(database, durable, watch)
    _miss_hosts(database)
    dispatch.settle(database, durable)


def _miss_hosts(database: Database) -> None:
    shown = select(Device.host).where(Device.presence != "offline", Device.host.is_not(None)).distinct()
    with database.reading() as session:
        missed = set(session.scalars(shown)) - registry.held_hosts(session)
    for host in sorted(str(name) for name in missed):
        with database.writing() as session:
            registry.host_gone(session, host)


def tidy(database: Database, durable: Durable) -> None:
    """Forget finished workflows and handed-on workers once they are older than anybody asks; jobs stay."""
    past = now() - KEPT
    lives.forget_before(database, past)
    while durable.forget_before(past):
        pass


@contextmanager
def caring(
    database: Database, durable: Durable, lease_s: float, tidy_up: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Look after the farm in a thread, to the end of the block, and tidy up now and then, with `tidy_up` besides."""
    ended, watch, trouble = threading.Event(), Watch(lease_s), Trouble(log)

    def run() -> None:
        tidied = 0.0
        while not ended.wait(min(CARE_S, lease_s / 10)):
            try:
                look_after(database, durable, watch)
                if not tidied or time.monotonic() - tidied > TIDY_S:
                    tidy(database, durable)
                    tidy_up()
                    tidied = time.monotonic()
                trouble.over()
            except AWAY as error:
                trouble.seen(error)
                watch.forget()
            except Exception:
                log.exception("looking after the farm failed; it is tried again")

    thread = threading.Thread(target=run, name="care", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
