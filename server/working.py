"""A worker process put together: database, queue, slices, and the devices that are attached to this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from renderer.bench import combine
from server.devices.tracker import Tracker
from server.queue.dispatch import settle
from server.queue.durable import Durable
from server.settings import Settings
from server.slices import SliceRunner
from server.store.database import Database
from server.worker import Worker


@contextmanager
def working(settings: Settings) -> Iterator[Worker]:
    """A worker on the settings' database, ended with the block; what it was doing is handed back."""
    database = Database(settings.database_url)
    durable = Durable(database)
    runner = SliceRunner(database, settings, lambda: worker.has_lease())
    worker = Worker(
        database,
        durable,
        runner,
        combine,
        host=settings.worker_host,
        lease_s=settings.lease_s,
        poll_s=settings.poll_s,
        pool=settings.llvmpipe,
    )

    def on_ready(_device: str) -> None:
        settle(database, durable)

    tracker = Tracker(database, settings.worker_host, on_ready, twin=settings.llvmpipe, phones=settings.phones)
    try:
        worker.start()
        tracker.start()
        try:
            yield worker
        finally:
            tracker.stop()
            worker.stop()
    finally:
        durable.close()
        database.close()
