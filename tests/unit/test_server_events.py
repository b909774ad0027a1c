"""Events from the store: none lost or told twice whatever order transactions commit in, one poll for all streams."""

from __future__ import annotations

import asyncio
import random
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, asynccontextmanager
from typing import Any

import pytest
from sqlalchemy import event as sqlalchemy_event
from sqlalchemy import select

from renderer.request import Request
from renderer.variant import Variant
from server.live import feed as feed_module
from server.live.events import Event, Topic, end_of, read_events
from server.live.feed import Feed
from server.live.settling import Settling
from server.store.database import Database
from server.store.models import Change, Job, Study
from server.store.records import Order, add_jobs, add_study, change_state
from server.store.states import State

ORDER = Order(Request("forest", Variant(), frames=2, rounds=2))


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    opened = Database(database_url)
    yield opened
    opened.close()


def add(database: Database, count: int = 1, study: bool = False) -> list[int]:
    """Jobs, of one study or of none; their ids."""
    with database.writing() as session:
        study_id = add_study(session, "x", {}, []).id if study else None
        slices = add_jobs(session, [ORDER] * count, study_id=study_id)
        return list(dict.fromkeys(part.job_id for part in slices))


def change(database: Database, job: int, *states: State) -> None:
    for state in states:
        with database.writing() as session:
            change_state(session, session.get_one(Job, job, with_for_update=True), state, f"now {state}")


def stored(database: Database) -> list[int]:
    with database.reading() as session:
        return list(session.scalars(select(Change.id).order_by(Change.id)))


def read(database: Database, after: int = 0, topic: Topic | None = None) -> list[Event]:
    with database.reading() as session:
        return read_events(session, after, 10**9, 1000, topic)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_settled_is_preceded_later(database: Database, seed: int) -> None:
    """Six writers in transactions of random length, some rolled back; a reader that only ever looks at what is new."""
    jobs = add(database, 6)
    settling = Settling(database)
    seen: list[int] = []

    def write(job: int) -> None:
        choice = random.Random(f"{seed} {job}")
        for number in range(15):
            try:
                with database.writing() as session:
                    change_state(session, session.get_one(Job, job, with_for_update=True), "running", str(number))
                    session.flush()
                    time.sleep(choice.choice([0, 0, 0.002, 0.01]))
                    if choice.random() < 0.2:
                        raise InterruptedError
            except InterruptedError:
                continue

    writers = [threading.Thread(target=write, args=(job,)) for job in jobs]
    for writer in writers:
        writer.start()
    while True:
        over = not any(writer.is_alive() for writer in writers)
        until = settling.settled()
        with database.reading() as session:
            after = seen[-1] if seen else 0
            seen += [each.id for each in read_events(session, after, until, 1000)]
        if over and until == max(stored(database)):
            break
    assert seen == stored(database)


def test_a_change_waits_for_older_transactions(
    fresh_database: Callable[[str], AbstractContextManager[str]],
) -> None:
    """PostgreSQL only: SQLite has one writer at a time."""
    with fresh_database("postgresql") as url:
        database = Database(url)
        slow, fast = add(database, 2)
        settling = Settling(database)
        before = settling.settled()
        with database.writing() as session:
            change_state(session, session.get_one(Job, slow), "running")
            session.flush()
            change(database, fast, "running")
            assert max(stored(database)) > before + 1
            assert [settling.settled(), settling.settled()] == [before, before]
            change(database, fast, "judging")  # Younger: it is not waited for.
        assert settling.settled() == before + 2
        assert settling.settled() == before + 3
        database.close()


def test_reading_does_not_hold_changes_back(database: Database) -> None:
    (job,) = add(database)
    settling = Settling(database)
    with database.reading() as session:
        session.scalars(select(Change)).all()
        change(database, job, "running")
        assert settling.settled() == max(stored(database))


def test_an_event_tells_what_its_change_was(database: Database) -> None:
    (job,) = add(database, study=True)
    change(database, job, "preparing")
    with database.writing() as session:
        session.get_one(Job, job).slices[0].state = "done"
        session.get_one(Job, job).slices[1].state = "failed"
    change(database, job, "failed")
    events = read(database)
    assert [(e.job, e.study, e.ends_job, e.ends_study) for e in events] == [
        (job, 1, False, False),
        (job, 1, False, False),
        (job, 1, True, True),
    ]
    assert '"state": "failed", "reason": "now failed"' in events[2].data
    progress = '{"done": 1, "ended": 1, "total": 2}'
    assert f'"progress": {progress}, "study_progress": {progress}' in events[2].data


def test_topics_tell_their_own_and_know_their_end(database: Database) -> None:
    first, second = add(database, 2, study=True)
    (other,) = add(database)
    change(database, second, "done")
    change(database, other, "done")
    study, alone = Topic(study=1), Topic(job=other)
    with database.reading() as session:
        assert end_of(session, study) is None
        assert end_of(session, alone) == stored(database)[-1]
    change(database, first, "cancelled")
    events = read(database)
    assert {e.job for e in read(database, topic=study)} == {first, second}
    for topic in (study, alone, Topic()):
        assert read(database, topic=topic) == [each for each in events if topic.covers(each)]
    assert [each.id for each in events if study.covers(each) and study.ended_by(each)] == [events[-1].id]
    assert [each.id for each in events if alone.covers(each) and alone.ended_by(each)] == [events[-2].id]
    assert not any(Topic().ended_by(each) for each in events)
    with database.reading() as session:
        assert end_of(session, study) == events[-1].id


def test_many_streams_cost_one_reading(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    (job,) = add(database)
    reads: list[int] = []

    def counted(*words: Any) -> list[Event]:
        reads.append(1)
        return read_events(*words)

    monkeypatch.setattr(feed_module, "read_events", counted)

    async def run() -> list[list[int]]:
        async with listening(database) as feed:
            waiting = [asyncio.create_task(take(feed, Topic(), None, 1)) for _ in range(50)]
            await until(lambda: feed._until is not None)
            await asyncio.sleep(0)
            await asyncio.to_thread(change, database, job, "running")
            return await asyncio.gather(*waiting)

    assert asyncio.run(run()) == [[stored(database)[-1]]] * 50
    assert len(reads) == 1


def test_nobody_listening_costs_nothing(database: Database) -> None:
    asked: list[str] = []

    async def run() -> None:
        feed = Feed(database, period_s=0.01)
        async with feed.listening():
            await until(lambda: feed._until is not None)
            assert feed.is_polling
        await until(lambda: not feed.is_polling)
        sqlalchemy_event.listen(database.engine, "before_cursor_execute", lambda *words: asked.append(words[2]))
        await asyncio.sleep(0.1)
        assert asked == []
        async with feed.listening():  # And it starts anew.
            await until(lambda: bool(asked))
        await feed.close()

    asyncio.run(run())


@pytest.mark.parametrize(("page", "kept"), [(2, 3), (500, 1000)])
def test_a_slow_stream_misses_nothing(
    database: Database, monkeypatch: pytest.MonkeyPatch, page: int, kept: int
) -> None:
    """A stream that is further behind than what the feed keeps reads the database itself."""
    monkeypatch.setattr(feed_module, "PAGE", page)
    monkeypatch.setattr(feed_module, "KEPT", kept)
    job, other = add(database, 2)

    async def run() -> list[int]:
        async with listening(database) as feed:
            stream = (each async for each in feed.follow(Topic(job=job), 0) if each is not None)
            seen = [(await anext(stream)).id]
            for _ in range(10):
                await asyncio.to_thread(change, database, job, "running", "judging")
                await asyncio.to_thread(change, database, other, "running")
            last = stored(database)[-1]
            await until(lambda: feed._until == last)
            while len(seen) < 21:
                seen.append((await anext(stream)).id)
            return seen

    assert asyncio.run(run()) == [each.id for each in read(database, topic=Topic(job=job))]


def test_the_end_of_a_feed_ends_its_streams(database: Database) -> None:
    (job,) = add(database)

    async def run() -> list[int]:
        async with listening(database) as feed:
            waiting = asyncio.create_task(take(feed, Topic(job=job), 0, 99))
            await until(lambda: feed._until is not None)
            feed.end()
            await feed.close()
            assert not feed.is_polling
            assert await take(feed, Topic(job=job), 0, 99) == []
            return await waiting

    assert asyncio.run(run()) in ([], [1])


def test_a_database_that_fails_for_a_while_is_asked_again(
    fresh_database: Callable[[str], AbstractContextManager[str]], caplog: pytest.LogCaptureFixture
) -> None:
    with fresh_database("postgresql") as url:
        database = Database(url)
        (job,) = add(database)

        async def run() -> list[int]:
            async with listening(database) as feed:
                waiting = asyncio.create_task(take(feed, Topic(job=job), 1, 1))
                await until(lambda: feed._until is not None)
                with database.engine.connect() as connection:
                    connection.exec_driver_sql("ALTER TABLE changes RENAME TO away")
                    connection.commit()
                    await until(lambda: "cannot be read" in caplog.text)
                    connection.exec_driver_sql("ALTER TABLE away RENAME TO changes")
                    connection.commit()
                await asyncio.to_thread(change, database, job, "running")
                return await waiting

        assert asyncio.run(run()) == [2]
        database.close()


def test_a_study_without_jobs_is_over(database: Database) -> None:
    with database.writing() as session:
        session.add(Study(name="x", request={}, refused=[]))
    with database.reading() as session:
        assert end_of(session, Topic(study=1)) == 0


@asynccontextmanager
async def listening(database: Database) -> AsyncIterator[Feed]:
    feed = Feed(database, period_s=0.02)
    async with feed.listening():
        yield feed
    await feed.close()


async def take(feed: Feed, topic: Topic, after: int | None, count: int) -> list[int]:
    seen: list[int] = []
    async for each in feed.follow(topic, after):
        if each is None:
            continue
        seen.append(each.id)
        if len(seen) == count:
            break
    return seen


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(20):
        while not condition():
            await asyncio.sleep(0.005)
