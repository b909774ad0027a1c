"""The time that stored studies still take."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from typing import Any

from sqlalchemy import Row, Select, and_, case, extract, func, select
from sqlalchemy.orm import Session

from server.devices.registry import TWIN, ready
from server.live.time_left import JobTimes, seconds_left
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Slice
from server.store.states import OPEN


def read_left(session: Session, studies: Collection[int]) -> dict[int | None, float | None]:
    """The seconds that each of the studies still takes, of its own work alone; None where that cannot be known yet."""
    jobs: dict[int | None, list[JobTimes]] = defaultdict(list)
    for row in session.execute(_times(studies)) if studies else ():
        jobs[row.study_id].append(_job(row))
    devices = _side_by_side(session, {job.device for known in jobs.values() for job in known}) if jobs else {}
    return {study: seconds_left(known, devices) for study, known in jobs.items()}


def _times(studies: Iterable[int]) -> Select[Any]:
    """Whole seconds are enough: what one slice loses by them the next one gains."""
    took = extract("epoch", Slice.ended_at) - extract("epoch", Slice.started_at)
    done, is_open = Slice.state == "done", Slice.state.in_(OPEN)
    first, later = Slice.round == 0, Slice.round > 0
    return (
        select(
            Job.study_id,
            Job.device,
            Job.scene,
            func.max(case((and_(first, done), took))).label("first_s"),
            func.avg(case((and_(later, done), took))).label("later_s"),
            func.count(case((and_(first, is_open), 1))).label("first_open"),
            func.count(case((and_(later, is_open), 1))).label("later_open"),
        )
        .join(Slice.job)
        .where(Job.study_id.in_(studies))
        .group_by(Job.id, Job.study_id, Job.device, Job.scene)
    )


def _job(row: Row[Any]) -> JobTimes:
    first, later = (None if each is None else float(each) for each in (row.first_s, row.later_s))
    return JobTimes(row.device, row.scene, first, later, row.first_open, row.later_open)


def _side_by_side(session: Session, devices: Iterable[str]) -> dict[str, int]:
    """How many slices of each device run at once: one where it is ready, of the pool one on each ready llvmpipe."""
    known = session.scalars(select(Device)).all()
    twins = sum(device.kind == TWIN and ready(device) for device in known)
    return dict.fromkeys(devices, 0) | {device.id: int(ready(device)) for device in known} | {LLVMPIPE: twins}
