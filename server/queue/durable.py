"""The durable queue itself: DBOS Transact on the store's database. Everything that speaks to DBOS from outside it."""

from __future__ import annotations

import logging
import threading
import uuid
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from dbos import DBOS, DBOSClient, EnqueueOptions
from sqlalchemy.orm import Session

from server.store.database import Database

APP = "rayfarm"
VERSION = "1"
"""Pinned: DBOS's own would change with every edit of a workflow and strand what is queued."""
WORKFLOW = "slice"
POOL = "llvmpipe"
"""The queue of slices that any host with llvmpipe may run."""
STOP_S = 10.0
"""How long a worker that ends waits for each thread that takes slices."""
# Without a handler DBOS takes standard error as it is when its first worker starts, closed or not later on.
logging.getLogger("dbos").addHandler(logging.NullHandler())


def host_queue(host: str) -> str:
    """The queue of the devices that are attached to one host; its partitions are device ids."""
    return f"host-{host}"


class Durable:
    """A client of the queue; a process opens it once, after its database, and closes it with `close`."""

    def __init__(self, database: Database) -> None:
        """Open the queue beside the store's tables, making its own where they are missing."""
        self.url = database.engine.url.render_as_string(hide_password=False)
        DBOS.migrate(self.url)
        # Of PostgreSQL it takes our engine: it compiles an enqueuing anew each time on a session of another one.
        place: dict[str, Any] = {"system_database_engine": database.engine}
        if database.engine.dialect.name == "sqlite":
            place = {"system_database_url": self.url, "system_database_pool_size": 2}
        self._client = DBOSClient(application_name=APP, retry_connection_errors=False, **place)

    def register_queues(self, host: str, poll_s: float) -> None:
        """Make the queues that a host's worker listens to, looked at every `poll_s` seconds."""
        self._client.register_queue(POOL, worker_concurrency=1, polling_interval_sec=poll_s)
        self._client.register_queue(
            host_queue(host), partition_concurrency=1, partition_worker_concurrency=1, polling_interval_sec=poll_s
        )

    def put(
        self, session: Session, slice_id: int, queue: str, partition: str | None, priority: int, delay_s: float
    ) -> str:
        """Enqueue a slice's workflow in the session's transaction and return its id.

        Of equal priority, the one enqueued first runs first; then, on a clock too coarse, the smaller slice id.
        """
        options: EnqueueOptions = {
            "workflow_name": WORKFLOW,
            "queue_name": queue,
            "workflow_id": f"slice-{slice_id:010d}-{uuid.uuid4().hex[:12]}",
            "priority": priority,
            "app_version": VERSION,
        }
        if partition is not None:
            options["queue_partition_key"] = partition
        if delay_s > 0:
            options["delay_seconds"] = delay_s
        self._client.enqueue_in_transaction(session, options, slice_id)
        return options["workflow_id"]

    def cancel(self, workflows: Sequence[str]) -> None:
        """Cancel workflows: a queued one never runs, a running one's step is interrupted within about a second."""
        if workflows:
            self._client.cancel_workflows(list(workflows))

    def resume(self, workflow: str, queue: str) -> None:
        """Put a workflow whose worker is gone back into its queue."""
        self._client.resume_workflow(workflow, queue_name=queue)

    def held_by(self, worker: str) -> list[tuple[str, str | None]]:
        """The unfinished workflows that a worker took, as (id, queue)."""
        found = self._client.list_workflows(status="PENDING", executor_id=worker, load_input=False, load_output=False)
        return [(status.workflow_id, status.queue_name) for status in found]

    def takers(self) -> set[str]:
        """The workers that took what is unfinished."""
        found = self._client.list_workflows(status="PENDING", load_input=False, load_output=False)
        return {status.executor_id for status in found if status.executor_id is not None}

    def forget_before(self, time: datetime, most: int = 1000) -> int:
        """Delete the records of at most `most` workflows that were over before a time; return how many."""
        over = self._client.list_workflows(
            status=["SUCCESS", "ERROR", "CANCELLED"],
            completed_before=time.isoformat(),
            limit=most,
            load_input=False,
            load_output=False,
        )
        if over:
            self._client.delete_workflows([status.workflow_id for status in over])
        return len(over)

    def close(self) -> None:
        """Close all connections."""
        self._client.destroy()


def configuration(url: str, worker: str, poll_s: float) -> Any:
    """DBOS's configuration for a worker process; `worker` must name this run of it alone."""
    return {
        "name": APP,
        "system_database_url": url,
        "application_version": VERSION,
        "executor_id": worker,
        "log_level": "ERROR",
        "enable_otlp": False,
        "run_migrations": False,
        "sys_db_pool_size": 5,
        "notification_listener_polling_interval_sec": poll_s,
    }


def stop_retrying(queue: DBOS) -> None:
    """Let what reads the queue fail, from now on, where the database does not answer.

    Its watch for cancelled slices retries for ever, on a thread that Python waits for at its end.
    """
    # Only a client has an argument for it (`retry_connection_errors`, DBOS 3.4).
    vars(queue._sys_db)["_retry_connection_errors"] = False


def stop_taking(queue: DBOS) -> None:
    """Take no more slices: at the end, whatever this worker took is handed to its event loop.

    DBOS stops that loop without waiting for the threads that feed it, and what comes too late is never awaited.
    """
    for event in queue.background_thread_stop_events:
        event.set()
    for thread in threading.enumerate():
        # One that is only about to start looks at the event first.
        if thread.name.startswith("queue-worker-") and thread.is_alive():
            thread.join(STOP_S)
