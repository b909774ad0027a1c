"""The worker: takes slices from the durable queue, has each measured by a leashed child, records the outcomes."""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any, TypeVar

from dbos import DBOS
from sqlalchemy import select

from renderer.child import AsyncSay
from renderer.host import DeviceGoneError
from renderer.request import Request
from server.logs import about, facts
from server.queue import ledger, lives
from server.queue.care import CARE_S, look_after
from server.queue.durable import POOL, WORKFLOW, Durable, configuration, host_queue, stop_retrying, stop_taking
from server.queue.ledger import Claim
from server.queue.trouble import Trouble, patiently
from server.queue.watch import Watch
from server.recommendations import asked_of
from server.spoken import spoken
from server.store.database import Database
from server.store.errors import AWAY, shortly
from server.store.models import Job, Json, Slice
from server.store.states import HELD, OPEN

log = logging.getLogger("rayfarm.worker")

RunSlice = Callable[[Claim, AsyncSay], Awaitable[Json]]
Returned = TypeVar("Returned")
Combine = Callable[[Request, list[Json]], Json]


class Worker:
    """Works on one database until it is stopped: one slice at a time on each of this host's devices.

    `run_slice` measures a claimed slice and `combine` makes a job's result; those of `server.slices`, or a test's. A
    process has one worker at a time. `host` names this machine's queue, `lease_s` is how long the worker may give no
    sign of life, `poll_s` how often it looks for work; `pool` says whether it takes slices that any llvmpipe may run.
    """

    def __init__(
        self,
        database: Database,
        durable: Durable,
        run_slice: RunSlice,
        combine: Combine,
        *,
        host: str,
        lease_s: float = 60.0,
        poll_s: float = 0.5,
        pool: bool = True,
    ) -> None:
        self.database, self.durable = database, durable
        self.run_slice, self.combine = run_slice, combine
        self.host, self.lease_s, self.poll_s = host, lease_s, poll_s
        self.queues = [*([POOL] if pool else []), host_queue(host)]
        self.name = lives.worker_id(secrets.token_hex(4))
        self._ended = threading.Event()
        self._in_hand = set[str]()
        self._strays: set[str] | None = None
        self._beaten_at = 0.0
        self._beating = threading.Thread(target=self._beat, name="signs-of-life", daemon=True)

    def start(self) -> None:
        """Register, and take slices from now on; call it from a thread that lives as long as the worker."""
        lives.begin(self.database, self.name, self.host)
        self._beaten_at = time.monotonic()
        self.durable.register_queues(self.host, self.poll_s)
        self._queue = DBOS(config=configuration(self.durable.url, self.name, self.poll_s))

        @DBOS.step(name="measure", preemptible=True)
        async def measure(slice_id: int, workflow: str) -> str:
            return await self._measure(slice_id, workflow)

        @DBOS.workflow(name=WORKFLOW)
        async def run(slice_id: int) -> str:
            workflow = DBOS.workflow_id
            assert workflow is not None
            self._in_hand.add(workflow)
            try:
                return await measure(slice_id, workflow)
            finally:
                self._in_hand.discard(workflow)

        DBOS.listen_queues(self.queues)
        DBOS.launch()
        self._beating.start()
        log.info("worker started", extra=facts(worker=self.name, host=self.host))

    def stop(self) -> None:
        """End what runs, hand it back, and take nothing more."""
        self._ended.set()
        self._beating.join()
        stop_retrying(self._queue)
        stop_taking(self._queue)
        DBOS.destroy(destroy_registry=True)
        try:
            lives.end(self.database, self.durable, self.name)
        except AWAY as error:
            log.warning("the database does not answer, so others will hand on what was held: %s", shortly(error))
        log.info("worker ended", extra=facts(worker=self.name))

    @property
    def given_up(self) -> bool:
        """Whether the others took this worker for dead: it must be stopped."""
        return self._ended.is_set()

    def is_idle(self) -> bool:
        """Whether nothing that this worker could run is queued or held."""
        reachable = Slice.queue.in_(self.queues)
        busy = select(Slice.id).join(Job).where(Job.state.in_(OPEN), Slice.state.in_(("queued", *HELD)), reachable)
        with self.database.reading() as session:
            return session.execute(busy.limit(1)).first() is None

    def has_lease(self) -> bool:
        """Whether nobody can have taken this worker for dead yet; its children live by it."""
        return time.monotonic() - self._beaten_at < self.lease_s / 2

    async def _measure(self, slice_id: int, workflow: str) -> str:
        held = await self._ask(lambda: ledger.claim(self.database, slice_id, workflow, self.name))
        if held is None:
            return "not wanted"
        named = {"job": held.job_id, "slice": held.slice_id, "round": held.round, "device": held.device}
        with about(**named, attempt=held.attempt):
            begun = time.monotonic()
            log.info("slice taken: %s", _title(held))
            outcome = await self._carry_out(held)
            log.info("slice %s", outcome, extra=facts(seconds=round(time.monotonic() - begun, 3)))
            return outcome

    async def _carry_out(self, held: Claim) -> str:
        """What came of a slice, in words for the log."""
        try:
            measurement = await self.run_slice(held, self._say(held))
        except asyncio.CancelledError:
            log.info("slice interrupted")
            with suppress(*AWAY):
                await self._ask(lambda: ledger.let_go(self.database, held))
            raise
        except DeviceGoneError as error:
            log.warning("%s", error)
            sentence = str(error)
            await self._ask(lambda: ledger.give_back(self.database, self.durable, held, sentence))
            return "given back: its device is gone"
        except Exception as error:
            sentence = _reason(error)
            await self._ask(lambda: ledger.fail(self.database, self.durable, held, sentence))
            return "failed"
        return await self._ask(lambda: self._record(held, measurement))

    async def _ask(self, ask: Callable[[], Returned]) -> Returned:
        """What one transaction of the ledger returns, once the database answers."""
        return await asyncio.to_thread(patiently, ask, self._ended, log)

    def _record(self, held: Claim, measurement: Json) -> str:
        def combine(measurements: list[Json]) -> Json | None:
            if asked_of(held.request) is not None:
                return None  # A recommendation stays with its slice: its frames are no result to compare.
            return self.combine(Request.from_json(held.request), measurements)

        try:
            recorded = ledger.record(self.database, held, measurement, combine)
        except AWAY:
            raise
        except Exception as error:
            ledger.fail(self.database, self.durable, held, _reason(error))
            return "failed"
        return "recorded" if recorded else "too late: another has it"

    def _say(self, held: Claim) -> AsyncSay:
        async def say(phase: Any) -> None:
            await self._ask(lambda: ledger.enter(self.database, held, phase))

        return say

    def _beat(self) -> None:
        """Signs of life, and the care for what others left; ends the worker when it has been given up."""
        watch, trouble = Watch(self.lease_s), Trouble(log)
        while not self._ended.wait(min(CARE_S, self.lease_s / 10)):
            try:
                begun = time.monotonic()
                if not lives.beat(self.database, self.name):
                    log.warning("This worker was taken for dead: it ends.")
                    self._ended.set()
                    return
                self._beaten_at = begun
                look_after(self.database, self.durable, watch)
                if trouble.over():
                    self._strays = set()
                self._take_up_strays()
            except AWAY as error:
                trouble.seen(error)
                watch.forget()
            except Exception:
                log.exception("a sign of life failed")

    def _take_up_strays(self) -> None:
        """After the database was away: put back what the queue counts as taken here, and nobody here has in hand.

        Its answer to our taking it was lost. What is begun just now is spared by looking twice, and fenced in any case.
        """
        if self._strays is None:
            return
        taken = dict(self.durable.held_by(self.name))
        strays = taken.keys() - self._in_hand
        for workflow in strays & self._strays:
            log.warning("a slice that was taken and not begun is put back", extra=facts(workflow=workflow))
            self.durable.resume(workflow, taken[workflow] or POOL)
        self._strays = strays or None


def _title(held: Claim) -> str:
    return f"{held.request.get('scene')}, {(held.request.get('variant') or {}).get('traversal')}"


def _reason(error: Exception) -> str:
    """An expected failure's sentence; an unexpected one is logged in full and named as such."""
    sentence = spoken(error)
    if sentence is not None:
        log.warning("%s", sentence)
        return sentence
    log.exception("a slice failed unexpectedly")
    return f"The measurement stopped unexpectedly: {type(error).__name__}: {error}."
