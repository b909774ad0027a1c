"""The worker: takes one slice at a time, measures it in a child process, records results."""

from __future__ import annotations

import logging
import secrets
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from renderer.request import Request
from server import queue
from server.spoken import spoken
from server.store.database import Database

log = logging.getLogger("rayfarm.worker")

RunSlice = Callable[[Request, int, float], dict[str, Any]]
Combine = Callable[[Request, list[dict[str, Any]]], dict[str, Any]]


class Stopped(BaseException):
    """The worker was told to end."""


class Worker:
    """Works on one database until it is stopped. Each slice's child holds the host's lock while it measures.

    `run_slice` and `combine` are those of `renderer.bench`, or a test's. A slice may take `timeout_s` seconds; a
    sign of life is given every third of `lease_s`.
    """

    def __init__(
        self,
        database: Database,
        run_slice: RunSlice,
        combine: Combine,
        *,
        timeout_s: float = 900.0,
        lease_s: float = 60.0,
    ) -> None:
        self.database = database
        self.run_slice = run_slice
        self.combine = combine
        self.timeout_s = timeout_s
        self.lease_s = lease_s
        self.name = queue.worker_name(secrets.token_hex(4))
        self._stop = threading.Event()

    def run(self, poll_s: float = 0.5) -> None:
        """Work until `stop` is called or `Stopped` is raised; look for work every `poll_s` seconds when idle."""
        while not self._stop.is_set():
            if not self.step():
                self._stop.wait(poll_s)

    def run_until_idle(self) -> None:
        """Work until the queue is empty."""
        while not self._stop.is_set() and self.step():
            pass

    def stop(self) -> None:
        """End after the slice in hand."""
        self._stop.set()

    def step(self) -> bool:
        """Take and measure one slice; False when there was none."""
        queue.requeue_lost(self.database, self.lease_s)
        self._record_results()
        claim = queue.claim_slice(self.database, self.name)
        if claim is None:
            return False
        self._measure(claim)
        self._record_results()
        return True

    def _measure(self, claim: queue.Claim) -> None:
        try:
            request = Request.from_json(claim.request)
            log.info("job %d, round %d: %s, %s", claim.job_id, claim.round, request.scene, request.variant.label)
            with self._beating(claim):
                measurement = self.run_slice(request, claim.round, self.timeout_s)
            queue.finish_slice(self.database, claim, self.name, measurement)
        except Stopped:
            queue.release_slice(self.database, claim, self.name)
            raise
        except Exception as error:
            queue.fail_slice(self.database, claim, self.name, _reason(error))

    def _record_results(self) -> None:
        for job in queue.measured_jobs(self.database):
            try:
                document = self.combine(Request.from_json(job.request), job.measurements)
                queue.finish_job(self.database, job.job_id, document)
            except Exception as error:
                queue.fail_job(self.database, job.job_id, _reason(error))

    @contextmanager
    def _beating(self, claim: queue.Claim) -> Iterator[None]:
        done = threading.Event()

        def run() -> None:
            while not done.wait(self.lease_s / 3):
                queue.beat(self.database, claim, self.name)

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


def stop_on_signals() -> None:
    """From now on SIGTERM and SIGINT raise `Stopped` in the main thread, once."""

    def handle(_number: int, _frame: FrameType | None) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_IGN)
        raise Stopped

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handle)


def _reason(error: Exception) -> str:
    """An expected failure's sentence; an unexpected one is logged in full and named as such."""
    sentence = spoken(error)
    if sentence is not None:
        log.warning("%s", sentence)
        return sentence
    log.exception("a slice failed unexpectedly")
    return f"The measurement stopped unexpectedly: {type(error).__name__}: {error}."
