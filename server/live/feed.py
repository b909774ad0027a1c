"""One look at the database for all who listen: new events go from here to every stream of this process."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress

from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from server.live.events import Event, Topic, read_events
from server.live.settling import Settling
from server.store.database import Database

PERIOD_S = 0.5
"""How often the database is asked for new changes while someone listens; it sets the delay of events."""
QUIET_S = 5.0
"""How long a stream waits before it is told that there is nothing new."""
PAGE = 500
KEPT = 2 * PAGE

log = logging.getLogger("rayfarm.events")


class Feed:
    """The events of one process. All but `settled` is for its event loop.

    A task polls while someone listens, and keeps the latest events: those with `_kept_after` < id <= `_until`. A stream
    that is further back, because it resumes or its client is slow, reads the database itself.
    """

    def __init__(self, database: Database, period_s: float = PERIOD_S) -> None:
        self._database = database
        self._period_s = period_s
        self._settling = Settling(database)
        self._listeners = 0
        self._polling: asyncio.Task[None] | None = None
        self._ended = asyncio.Event()
        self._news = asyncio.Event()
        self._latest: deque[Event] = deque()
        self._kept_after = 0
        self._until: int | None = None

    @property
    def is_polling(self) -> bool:
        """Whether the database is being asked."""
        return self._polling is not None

    def settled(self) -> int:
        """The id up to which changes are final: what is read after this call shows them all. For any thread."""
        return self._settling.settled()

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[Feed]:
        """Poll while the block lasts."""
        self._listeners += 1
        if self._polling is None and not self._ended.is_set():
            self._polling = asyncio.create_task(self._poll(), name="feed")
        try:
            yield self
        finally:
            self._listeners -= 1

    async def follow(self, topic: Topic, after: int | None) -> AsyncIterator[Event | None]:
        """The topic's events with a larger id than `after`, by default those from now on, until the feed ends.

        None comes between them, every `QUIET_S` seconds at least, when there is nothing to tell. To be used within
        `listening`. Raise SQLAlchemyError when the database does not answer.
        """
        position = after
        while not self._ended.is_set():
            news, until = self._news, self._until
            if until is not None and position is None:
                position = until
            if until is None or position is None or position >= until:
                if not await _comes(news):
                    yield None
                continue
            events, position = await self._between(topic, position, until)
            if not events:
                yield None
            for event in events:
                yield event

    def end(self) -> None:
        """End every stream, now and from now on."""
        self._ended.set()
        self._tell()

    async def close(self) -> None:
        """End, and wait until the database is no longer asked."""
        self.end()
        if self._polling is not None:
            await self._polling

    async def _between(self, topic: Topic, position: int, until: int) -> tuple[list[Event], int]:
        """The next of the topic's events, and the id up to which these are all."""
        if position >= self._kept_after:
            return [event for event in self._latest if event.id > position and topic.covers(event)], until
        events = await run_in_threadpool(self._read, position, until, topic)
        return events, events[-1].id if len(events) == PAGE else until

    async def _poll(self) -> None:
        failing = False
        try:
            while self._listeners and not self._ended.is_set():
                try:
                    while await self._take():
                        pass
                    failing = False
                except SQLAlchemyError:
                    if not failing:
                        log.warning("The changes cannot be read now: trying on.", exc_info=True)
                    failing = True
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._ended.wait(), self._period_s)
        finally:
            self._polling, self._until = None, None
            self._latest.clear()

    async def _take(self) -> bool:
        """Take the next events in and tell the streams; whether there may be more at once."""
        settled = await run_in_threadpool(self.settled)
        if self._until is None:
            self._until = self._kept_after = settled
            self._tell()
            return False
        if settled <= self._until:
            return False
        events = await run_in_threadpool(self._read, self._until, settled)
        self._latest.extend(events)
        while len(self._latest) > KEPT:
            self._kept_after = self._latest.popleft().id
        full = len(events) == PAGE
        self._until = events[-1].id if full else settled
        self._tell()
        return full

    def _read(self, after: int, until: int, topic: Topic | None = None) -> list[Event]:
        with self._database.reading() as session:
            return read_events(session, after, until, PAGE, topic)

    def _tell(self) -> None:
        self._news.set()
        self._news = asyncio.Event()


async def _comes(news: asyncio.Event) -> bool:
    with suppress(TimeoutError):
        return await asyncio.wait_for(news.wait(), QUIET_S)
    return False
