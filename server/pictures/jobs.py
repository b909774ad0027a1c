"""The jobs that have pictures, as their results name them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from renderer.pictures.counts import METRICS
from server.api.views import find_job
from server.keeping.prune import pruned_at
from server.pictures.taken import is_name
from server.problems import Problem
from server.store.models import Job, Result

WHATS = {"image": "rendered image", **METRICS}
"""What of a job can be shown, and how it is called."""

LOOKED_AT = 1000
"""How many of the newest results are looked through for pictures."""


@dataclass(frozen=True)
class Pictured:
    """A job whose result names pictures; `image` and `counts` are names of blobs."""

    job: int
    study: int | None
    scene: str
    device: str
    label: str
    size: tuple[int, int]
    image: str
    counts: str | None

    @property
    def title(self) -> str:
        """The job in one line."""
        return f"{self.job}: {self.label}, {self.size[0]}x{self.size[1]}, {self.device}"

    def name_of(self, what: str) -> str:
        """The blob that shows `what`; raise Problem 404 where nothing was counted."""
        name = self.image if what == "image" else self.counts
        if name is None:
            raise Problem(404, f"Job {self.job} has no counts: its run carries no counters.")
        return name


def find_pictured(session: Session, job_id: str) -> Pictured:
    """A job with pictures by the id in an address; raise Problem 404 when it has none."""
    job = find_job(session, job_id)
    rows = session.execute(_pictured().where(Result.job_id == job.id)).all()
    found = _read(rows)
    if not found:
        day = pruned_at(job.result.document, "files") if job.result else None
        if day is not None:
            raise Problem(410, f"The pictures of job {job_id} were pruned on {day}; its result stays.")
        state = "" if job.state == "done" else f" and is {job.state}"
        raise Problem(404, f"Job {job_id} has no picture{state}: submit it again to have one.")
    return found[0]


def list_pictured(
    session: Session, *, scene: str | None = None, study: int | None = None, looked_at: int = LOOKED_AT
) -> list[Pictured]:
    """The jobs with pictures among the newest `looked_at` results of a scene and a study, the newest first."""
    newest = select(Result.id).order_by(Result.id.desc()).limit(looked_at)
    if scene is not None:
        newest = newest.where(Result.scene == scene)
    if study is not None:
        newest = newest.where(Result.study_id == study)
    # The documents are large: the database takes the few values out of them.
    found = _pictured().where(Result.id.in_(newest.scalar_subquery())).order_by(Result.id.desc())
    return _read(session.execute(found).all())


def _pictured() -> Select[Any]:
    columns = (Result.job_id, Result.study_id, Result.scene, Result.device, Job.label)
    return select(*columns, Result.document["size"], Result.document["pictures"]).join(Job, Job.id == Result.job_id)


def _read(rows: Sequence[Any]) -> list[Pictured]:
    """The rows whose document names pictures as a measurement does; it may have been imported."""
    found = []
    for job, study, scene, device, label, size, pictures in rows:
        named = pictures if isinstance(pictures, dict) else {}
        image, counts = named.get("image"), named.get("counts")
        if is_name(image) and (counts is None or is_name(counts)) and _is_size(size):
            found.append(Pictured(job, study, scene, device, label, (size[0], size[1]), image, counts))
    return found


def _is_size(size: object) -> bool:
    return isinstance(size, list) and len(size) == 2 and all(isinstance(side, int) for side in size)
