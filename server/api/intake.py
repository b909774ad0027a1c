"""Jobs that are sent at the same time share a transaction: group commit (DeWitt et al. 1984, section 5.2).

A transaction's round trips and its flush to disk cost more than the rows of a job. Nobody waits for company: one
transaction runs at a time, and the next takes whoever came meanwhile.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import Request, Response
from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from scenes.scene import SceneError
from server.api.idempotency import Answer, Submission, answer_once, keep, log_accepted
from server.api.views import job_view
from server.devices.registry import DeviceError
from server.queue.dispatch import require_device, submit
from server.queue.durable import Durable
from server.scene_list import require_scene
from server.store.database import Database
from server.store.errors import AWAY
from server.store.models import Job, Submitted
from server.store.records import Order

log = logging.getLogger("rayfarm.api")

MOST = 64
"""Jobs in one transaction: others may wait for its locks."""


@dataclass(frozen=True)
class Sent:
    """One job as it was sent."""

    submission: Submission
    order: Order


class Intake:
    """Takes jobs in, for one process. `take` and `close` are for its event loop."""

    def __init__(self, database: Database, durable: Durable) -> None:
        self._database, self._durable = database, durable
        self._waiting: list[tuple[Sent, asyncio.Future[Response]]] = []
        self._taking: asyncio.Task[None] | None = None

    async def take(self, sent: Sent) -> Response:
        """The answer to a job, once it is committed; raise what `answer_once` and its checks raise."""
        answered: asyncio.Future[Response] = asyncio.get_running_loop().create_future()
        self._waiting.append((sent, answered))
        if self._taking is None:
            self._taking = asyncio.create_task(self._take_all(), name="intake")
        return await answered

    async def close(self) -> None:
        """Wait until all that was sent is answered."""
        if self._taking is not None:
            await self._taking

    async def _take_all(self) -> None:
        try:
            while self._waiting:
                group, self._waiting = self._waiting[:MOST], self._waiting[MOST:]
                outcomes = await run_in_threadpool(self._answer, [sent for sent, _ in group])
                for (_, answered), outcome in zip(group, outcomes, strict=True):
                    if answered.done():  # Its request was given up meanwhile.
                        continue
                    if isinstance(outcome, Exception):
                        answered.set_exception(outcome)
                    else:
                        answered.set_result(outcome)
        finally:
            self._taking = None

    def _answer(self, group: Sequence[Sent]) -> list[Response | Exception]:
        """What each is answered with, or what is wrong with it."""
        if len(group) == 1:
            return [self._alone(group[0])]
        try:
            together = self._together(group)
        except AWAY as error:
            return [error] * len(group)
        except IntegrityError:  # Another server has one's key just now.
            together = [None] * len(group)
        except Exception:
            log.exception("jobs that came at once could not be taken at once: each is taken by itself")
            together = [None] * len(group)
        return [self._alone(sent) if found is None else found for sent, found in zip(group, together, strict=True)]

    def _together(self, group: Sequence[Sent]) -> list[Response | None]:
        """Commit all that are plainly new, as one; the others get None."""
        answers: list[Answer | None] = [None] * len(group)
        with self._database.writing() as session:
            new = self._new(session, group)
            jobs = submit(session, self._durable, [group[index].order for index in new])
            for index, job in zip(new, jobs, strict=True):
                answers[index] = answer = _answer(job)
                keep(session, group[index].submission, answer)
        told = zip(answers, group, strict=True)
        return [None if answer is None else log_accepted(answer, sent.submission) for answer, sent in told]

    def _new(self, session: Session, group: Sequence[Sent]) -> list[int]:
        """Those whose keys nobody has sent before, and whose scenes and devices there are."""
        keys = [sent.submission.kept_as for sent in group]
        taken = set(session.scalars(select(Submitted.key).where(Submitted.key.in_([key for key in keys if key]))))
        new = []
        for index, (sent, key) in enumerate(zip(group, keys, strict=True)):
            if key in taken or not _is_sound(session, sent.order):
                continue
            new.append(index)
            if key is not None:
                taken.add(key)
        return new

    def _alone(self, sent: Sent) -> Response | Exception:
        def create(session: Session) -> Answer:
            require_scene(sent.order.request.scene)
            return _answer(*submit(session, self._durable, [sent.order]))

        try:
            return answer_once(self._database, sent.submission, create)
        except Exception as error:
            return error


def intake_of(request: Request) -> Intake:
    """The intake of the app that a request came to."""
    intake = request.app.state.intake
    assert isinstance(intake, Intake)
    return intake


def _answer(job: Job) -> Answer:
    return Answer(job_view(job), f"/api/v1/jobs/{job.id}")


def _is_sound(session: Session, order: Order) -> bool:
    try:
        require_scene(order.request.scene)
        require_device(session, order.device)
    except (SceneError, DeviceError):
        return False
    return True
