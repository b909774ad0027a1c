"""Progress as server-sent events (HTML Standard, 9.2), resumed by `Last-Event-ID`."""

from __future__ import annotations

import json
import logging
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request
from fastapi.sse import EventSourceResponse, ServerSentEvent
from sqlalchemy.exc import SQLAlchemyError

from server.access.stays import ENDED, Stay
from server.api.state import database_of
from server.api.views import MAX_ID, find_job, find_study
from server.live.events import Event, Topic, end_of
from server.live.feed import Feed

log = logging.getLogger("rayfarm.events")
router = APIRouter(prefix="/api/v1")


@dataclass(frozen=True)
class Wanted:
    """What a client asked for: a topic's events after an id; `over` when there are none and never will be."""

    topic: Topic
    after: int | None
    over: bool


def feed_of(request: Request) -> Feed:
    """The feed of the app that a request came to."""
    feed = request.app.state.feed
    assert isinstance(feed, Feed)
    return feed


async def _listen(request: Request) -> AsyncIterator[Feed]:
    async with feed_of(request).listening() as feed:
        yield feed


def _read_after(
    after: Annotated[int | None, Query(ge=0, le=MAX_ID, description="only events with a larger id")] = None,
    last_event_id: Annotated[int | None, Header(ge=0, le=MAX_ID, description="the same; it goes before")] = None,
) -> int | None:
    # A browser that connects again sends the header with the address of its first request.
    return after if last_event_id is None else last_event_id


async def _stay(request: Request) -> Stay:
    return Stay(request, database_of(request))


Listening = Annotated[Feed, Depends(_listen)]
Staying = Annotated[Stay, Depends(_stay)]
After = Annotated[int | None, Depends(_read_after)]


def _want_job(job_id: str, request: Request, after: After) -> Wanted:
    with database_of(request).reading() as session:
        topic = Topic(job=find_job(session, job_id).id)
        return _want(topic, after or 0, end_of(session, topic))


def _want_study(study_id: str, request: Request, after: After) -> Wanted:
    with database_of(request).reading() as session:
        topic = Topic(study=find_study(session, study_id).id)
        return _want(topic, after or 0, end_of(session, topic))


def _want(topic: Topic, after: int, end: int | None) -> Wanted:
    return Wanted(topic, after, over=end is not None and end <= after)


@router.get("/jobs/{job_id}/events", response_class=EventSourceResponse)
async def job_events(
    wanted: Annotated[Wanted, Depends(_want_job)], feed: Listening, stay: Staying
) -> AsyncIterator[ServerSentEvent]:
    """A job's changes of state from its first on, each a `change`; an `end` when it is over."""
    async for event in _stream(feed, wanted, stay):
        yield event


@router.get("/studies/{study_id}/events", response_class=EventSourceResponse)
async def study_events(
    wanted: Annotated[Wanted, Depends(_want_study)], feed: Listening, stay: Staying
) -> AsyncIterator[ServerSentEvent]:
    """The changes of state of a study's jobs from the first on, each a `change`; an `end` when all are over."""
    async for event in _stream(feed, wanted, stay):
        yield event


@router.get("/events", response_class=EventSourceResponse)
async def all_events(after: After, feed: Listening, stay: Staying) -> AsyncIterator[ServerSentEvent]:
    """The changes of state of all jobs from now on, or after an id; without an end."""
    async for event in _stream(feed, Wanted(Topic(), after, over=False), stay):
        yield event


async def _stream(feed: Feed, wanted: Wanted, stay: Stay) -> AsyncIterator[ServerSentEvent]:
    if wanted.over:
        yield _end(wanted.topic)
        return
    try:
        async for event in feed.follow(wanted.topic, wanted.after):
            if not await stay.lasts():
                yield ServerSentEvent(event="refused", raw_data=json.dumps({"detail": ENDED}))
                return
            if event is None:
                continue
            yield _change(event)
            if wanted.topic.ended_by(event):
                yield _end(wanted.topic)
                return
    except SQLAlchemyError:
        log.warning("A stream of events ended: the database does not answer.", exc_info=True)


def _change(event: Event) -> ServerSentEvent:
    return ServerSentEvent(event="change", id=str(event.id), raw_data=event.data)


def _end(topic: Topic) -> ServerSentEvent:
    # Without an id: the client's last id stays that of the last change.
    return ServerSentEvent(event="end", raw_data=json.dumps(asdict(topic)))
