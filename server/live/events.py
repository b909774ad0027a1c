"""Changes of state as events: what a stream of them tells, read from the database."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from server.live.study_left import read_left
from server.live.time_left import write_left
from server.store.models import Change, Job, Slice
from server.store.states import OPEN

Progress = dict[str, int]


@dataclass(frozen=True)
class Event:
    """One change; `data` is its JSON text (ASCII, one line). It may be the last of its job and of its study."""

    id: int
    job: int
    study: int | None
    ends_job: bool
    ends_study: bool
    data: str


@dataclass(frozen=True)
class Topic:
    """What a stream tells of: one job, one study, or with neither everything."""

    job: int | None = None
    study: int | None = None

    def covers(self, event: Event) -> bool:
        """Whether the event belongs to it."""
        return self.job in (None, event.job) and self.study in (None, event.study)

    def ended_by(self, event: Event) -> bool:
        """Whether nothing more will happen after this event of its own."""
        if self.job is not None:
            return event.ends_job
        return self.study is not None and event.ends_study


def read_events(session: Session, after: int, until: int, limit: int, topic: Topic | None = None) -> list[Event]:
    """The first `limit` events with `after` < id <= `until`, in their order; `until` must be settled.

    The progress in them is that of the moment of reading, in slices, and so is the time left.
    """
    query = select(Change, Job.study_id).join(Job, Job.id == Change.job_id)
    query = query.where(Change.id > after, Change.id <= until).order_by(Change.id).limit(limit)
    if topic is not None:
        wanted = {Job.id: topic.job, Job.study_id: topic.study}
        query = query.where(*(column == value for column, value in wanted.items() if value is not None))
    rows = [(change, study) for change, study in session.execute(query)]
    jobs = _progress(session, Job.id, {change.job_id for change, _ in rows})
    ids = {study for _, study in rows if study is not None}
    studies, ends = _progress(session, Job.study_id, ids), _study_ends(session, ids)
    left = read_left(session, ids)
    return [
        Event(
            change.id,
            change.job_id,
            study,
            change.state not in OPEN,
            ends.get(study) == change.id,
            _data(change, study, jobs[change.job_id], studies.get(study), left.get(study)),
        )
        for change, study in rows
    ]


def end_of(session: Session, topic: Topic) -> int | None:
    """The id of the last event of a job or a study that is over, None for one that is not."""
    if topic.job is not None:
        last = select(func.max(Change.id)).join(Job).where(Job.id == topic.job, Job.state.not_in(OPEN))
        return session.scalar(last)
    return _study_ends(session, () if topic.study is None else (topic.study,)).get(topic.study)


def _data(
    change: Change, study: int | None, progress: Progress, study_progress: Progress | None, left_s: float | None
) -> str:
    told: dict[str, Any] = {
        "job": change.job_id,
        "study": study,
        "state": change.state,
        "reason": change.reason,
        "at": change.at.isoformat(timespec="milliseconds"),
        "progress": progress,
        "study_progress": study_progress,
        "study_left": write_left(left_s),
    }
    return json.dumps(told)


def _progress(session: Session, owner: InstrumentedAttribute[Any], ids: Iterable[int]) -> dict[int | None, Progress]:
    """Slices done, ended without a measurement, and in all, for jobs or studies."""
    found: dict[int | None, Progress] = {number: {"done": 0, "ended": 0, "total": 0} for number in ids}
    counted = select(owner, Slice.state, func.count()).join(Slice, Slice.job_id == Job.id)
    counted = counted.where(owner.in_(found)).group_by(owner, Slice.state)
    for number, state, count in session.execute(counted) if found else ():
        found[number]["total"] += count
        if state not in OPEN:
            found[number]["done" if state == "done" else "ended"] += count
    return found


def _study_ends(session: Session, ids: Iterable[int]) -> dict[int | None, int]:
    """The last change of each of the studies that have no open job; 0 where there never was one."""
    wanted = set(ids)
    if wanted:
        wanted -= set(session.scalars(select(Job.study_id).where(Job.study_id.in_(wanted), Job.state.in_(OPEN))))
    if not wanted:
        return {}
    last = select(Job.study_id, func.max(Change.id)).join(Change, Change.job_id == Job.id)
    found = session.execute(last.where(Job.study_id.in_(wanted)).group_by(Job.study_id))
    return dict.fromkeys(wanted, 0) | dict(found.all())
