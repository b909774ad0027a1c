"""Jobs that are sent at the same time are committed together, and each is answered as if it had been sent alone."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import pytest
from fastapi import Response
from sqlalchemy import event, func, select
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session

from renderer.request import Request
from renderer.variant import Variant
from scenes.scene import SceneError
from server.api.idempotency import Submission
from server.api.intake import Intake, Sent
from server.devices.registry import DeviceError
from server.problems import Problem
from server.queue.durable import Durable
from server.store.database import Database
from server.store.models import Job, Slice, Submitted
from server.store.records import Order


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    database = Database(database_url)
    yield database
    database.close()


@pytest.fixture
def durable(database: Database) -> Iterator[Durable]:
    durable = Durable(database)
    yield durable
    durable.close()


def sent(
    key: str | None,
    scene: str = "forest",
    device: str = "llvmpipe",
    priority: int = 100,
    rounds: int = 1,
    digest: str = "",
) -> Sent:
    order = Order(Request(scene, Variant(), frames=2, rounds=rounds), device, priority)
    return Sent(Submission(key, digest or f"digest of {key}"), order)


def take(database: Database, durable: Durable, *together: Sent) -> list[Any]:
    """What each of several at once is answered with or refused by."""

    async def run() -> list[Response | BaseException]:
        intake = Intake(database, durable)
        return await asyncio.gather(*map(intake.take, together), return_exceptions=True)

    return asyncio.run(run())


def commits(database: Database) -> list[object]:
    """The commits from now on."""
    seen: list[object] = []
    event.listen(database.engine, "commit", seen.append)
    return seen


def stored(database: Database) -> tuple[int, int]:
    with database.reading() as session:
        queued = select(func.count(Slice.id)).where(Slice.workflow.is_not(None), Slice.queue.is_not(None))
        return session.scalar(select(func.count(Job.id))) or 0, session.scalar(queued) or 0


def test_what_comes_at_once_is_committed_at_once(database: Database, durable: Durable) -> None:
    seen = commits(database)
    answers = take(
        database, durable, *(sent(f"k{n}" if n % 3 else None, priority=n + 1, rounds=1 + n % 2) for n in range(12))
    )
    assert len(seen) == 1
    assert stored(database) == (12, 18)
    assert [answer.status_code for answer in answers] == [201] * 12
    places = [answer.headers["location"] for answer in answers]
    assert len(set(places)) == 12
    with database.reading() as session:
        for number, place in enumerate(places):
            job = session.get_one(Job, int(place.rpartition("/")[2]))
            assert (job.priority, len(job.slices), job.request["rounds"]) == (
                number + 1,
                1 + number % 2,
                1 + number % 2,
            )
            kept = session.get(Submitted, f"k{number}")
            assert (kept is not None and kept.location) == (place if number % 3 else False)
    again = take(database, durable, *(sent(f"k{n}") for n in (1, 2, 4)))
    assert [answer.headers["idempotent-replayed"] for answer in again] == ["true"] * 3
    assert [answer.body for answer in again] == [answers[n].body for n in (1, 2, 4)]
    assert stored(database) == (12, 18)


def test_each_is_refused_for_itself(database: Database, durable: Durable) -> None:
    take(database, durable, sent("old"))
    seen = commits(database)
    group = [
        sent("a"),
        sent("b", scene="atlantis"),
        sent("twice"),
        sent("old"),
        sent("c", device="nobody"),
        sent("twice"),
        sent("old", digest="another"),
        sent("d"),
        sent("twice", digest="another"),
    ]
    a, b, first, old, c, second, other, d, third = take(database, durable, *group)
    assert [answer.status_code for answer in (a, first, old, second, d)] == [201] * 5
    assert isinstance(b, SceneError)
    assert isinstance(c, DeviceError)
    assert isinstance(other, Problem)
    assert isinstance(third, Problem)
    assert first.body == second.body
    assert [("idempotent-replayed" in answer.headers) for answer in (a, first, old, second, d)] == [0, 0, 1, 1, 0]
    assert stored(database) == (4, 4)
    assert len(seen) <= 3  # That of the three new ones, and those of two that only read.


def test_a_database_that_fails_them_takes_none(database: Database, durable: Durable) -> None:
    def fail(_: object) -> None:
        raise OperationalError("COMMIT", {}, Exception("disk full"))

    event.listen(database.engine, "commit", fail)
    group = [sent(f"k{number}") for number in range(5)]
    answers = take(database, durable, *group)
    assert all(isinstance(answer, OperationalError) for answer in answers)
    assert stored(database) == (0, 0)
    event.remove(database.engine, "commit", fail)
    assert [answer.status_code for answer in take(database, durable, *group)] == [201] * 5
    assert stored(database) == (5, 5)


def test_a_key_that_another_server_takes_meanwhile_holds_up_nobody_else(
    fresh_database: Callable[[str], AbstractContextManager[str]],
) -> None:
    """Its transaction has written the key, and commits once the group waits for it; SQLite has one writer at a time."""
    with fresh_database("postgresql") as url:
        database = Database(url)
        durable, group, answers = Durable(database), [sent(f"k{number}") for number in range(4)], list[Any]()
        taking = threading.Thread(target=lambda: answers.extend(take(database, durable, *group)))
        with database.writing() as session:
            session.add(Submitted(key="k2", digest="digest of k2", status=201, location="/api/v1/jobs/77", body={}))
            session.flush()
            taking.start()
            taking.join(1.0)
            assert taking.is_alive()
        taking.join(20)
        assert [answer.headers["location"] == "/api/v1/jobs/77" for answer in answers] == [False, False, True, False]
        assert stored(database) == (3, 3)
        durable.close()
        database.close()


def test_what_nobody_expected_is_each_ones_own(
    database: Database, durable: Durable, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    real = durable.put

    def put(session: Session, slice_id: int, queue: str, partition: str | None, priority: int, delay_s: float) -> str:
        if priority == 13:
            raise RuntimeError("unlucky")
        return real(session, slice_id, queue, partition, priority, delay_s)

    monkeypatch.setattr(durable, "put", put)
    answers = take(database, durable, *(sent(f"k{number}", priority=number) for number in range(12, 16)))
    assert [isinstance(answer, RuntimeError) for answer in answers] == [False, True, False, False]
    assert stored(database) == (3, 3)
    assert "could not be taken at once" in caplog.text


def test_it_ends_when_all_are_answered(database: Database, durable: Durable) -> None:
    """A request that was given up is taken all the same: its answer is kept for when it is asked for again."""

    async def run() -> list[Any]:
        intake = Intake(database, durable)
        waiting = [asyncio.create_task(intake.take(sent(f"k{number}"))) for number in range(3)]
        await asyncio.sleep(0)
        waiting[1].cancel()
        await intake.close()
        assert all(task.done() for task in waiting)
        return await asyncio.gather(*waiting, return_exceptions=True)

    answers = asyncio.run(run())
    assert isinstance(answers[1], asyncio.CancelledError)
    assert stored(database) == (3, 3)
