"""The false alarms of each device by its latest stored study `aa`."""

from __future__ import annotations

from collections.abc import Collection

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.comparison.false_alarms import FalseAlarms, count_alarms
from server.store.models import Result, Study

SAME = "aa"
"""The study that measures one request against itself."""
LATEST = 50
"""So many of them are looked at."""


def latest_alarms(session: Session, devices: Collection[str] | None = None) -> list[tuple[int, FalseAlarms]]:
    """Each device's latest study `aa` with a pair in it, and what it found; of all devices unless some are named."""
    same = session.scalars(select(Study.id).where(Study.name == SAME).order_by(Study.id.desc()).limit(LATEST)).all()
    newest = select(Result.device, func.max(Result.study_id)).where(Result.study_id.in_(same))
    newest = newest.group_by(Result.device).order_by(Result.device)
    if devices is not None:
        newest = newest.where(Result.device.in_(devices))
    found = []
    for device, study in session.execute(newest):
        assert study is not None
        results = select(Result.document).where(Result.study_id == study, Result.device == device).order_by(Result.id)
        found += [(study, alarms) for alarms in count_alarms(session.scalars(results).all())]
    return found
