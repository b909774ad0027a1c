"""Importing a received file for a job: all of it or nothing."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import PureWindowsPath
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from server.api.views import MAX_ID, find_job
from server.problems import Problem
from server.profiles.child import read_in_child
from server.profiles.paper import paper_figures
from server.profiles.reader import Imported
from server.profiles.summary import Summary
from server.store.blobs import Blobs, Incoming
from server.store.database import Database
from server.store.models import Job, Profile, ProfileMetric

MAX_FILE_NAME = 200
UNNAMED = "profile.csv"


def require_measured(session: Session, job_id: str, *, for_update: bool = False) -> Job:
    """A job that has a result; raise Problem 404 or 409 for any other."""
    job = find_job(session, job_id, for_update=for_update)
    if job.result is None:
        raise Problem(409, f"Job {job_id} is {job.state} and has no result: a profile is imported for a measured job.")
    return job


def import_file(
    database: Database,
    blobs: Blobs,
    incoming: Incoming,
    job_id: str,
    file_name: str,
    form: str,
    column_map: Mapping[str, str],
) -> tuple[dict[str, Any], bool]:
    """Read a received file and store it; return its view, and whether it is new: the same again is found again.

    Raise ProfileError, or Problem for a job that has no result; then nothing was stored. The blob is kept before the
    transaction that names it: where that fails, a blob that nobody names is left.
    """
    incoming.flush()
    imported = read_in_child(incoming.path, form, column_map)
    sha256 = blobs.keep(incoming)
    profile = Profile(
        format=imported.format,
        column_map=dict(column_map) or None,
        file_name=clean_name(file_name),
        sha256=sha256,
        size=incoming.size,
        rows=imported.rows,
    )
    with database.writing() as session:
        job = require_measured(session, job_id, for_update=True)
        there = job_profiles(session, job)
        same = next((one for one in there if _identity(one) == _identity(profile)), None)
        if same is None:
            _add(session, job, profile, imported, there)
        else:
            same.pruned_at = None  # Its text is here again.
        stored = same or profile
        return profile_view(stored, with_metrics=True), same is None


def job_profiles(session: Session, job: Job) -> list[Profile]:
    """A job's profiles, the latest import first."""
    return list(session.scalars(select(Profile).where(Profile.job_id == job.id).order_by(Profile.id.desc())))


def find_profile(session: Session, job_id: str, profile_id: str) -> Profile:
    """One profile of a job by the ids in a path; raise Problem 404 when there is none."""
    job = find_job(session, job_id)
    number = int(profile_id) if re.fullmatch(r"[0-9]{1,10}", profile_id) else 0
    profile = session.get(Profile, number) if 0 < number <= MAX_ID else None
    if profile is None or profile.job_id != job.id:
        raise Problem(404, f"Job {job_id} has no profile {profile_id}.")
    return profile


def profile_view(profile: Profile, *, with_metrics: bool) -> dict[str, Any]:
    """A profile as the API shows it."""
    url = f"/api/v1/jobs/{profile.job_id}/profiles/{profile.id}"
    view = {
        "id": profile.id,
        "job": profile.job_id,
        "format": profile.format,
        "map": profile.column_map,
        "file_name": profile.file_name,
        "sha256": profile.sha256,
        "size": profile.size,
        "rows": profile.rows,
        "imported_at": profile.imported_at.isoformat(timespec="milliseconds"),
        "time_unit": "unverified",
        "pruned_at": profile.pruned_at and profile.pruned_at.date().isoformat(),
        "url": url,
        "file": f"{url}/file",
    }
    return {**view, "metrics": [_metric_view(metric) for metric in profile.metrics]} if with_metrics else view


def clean_name(file_name: str) -> str:
    """A file's own name, without folders and control characters."""
    plain = "".join(character for character in PureWindowsPath(file_name).name if character.isprintable())
    return plain.strip(". ")[:MAX_FILE_NAME] or UNNAMED


def _add(session: Session, job: Job, profile: Profile, imported: Imported, there: Sequence[Profile]) -> None:
    profile.job_id = job.id
    profile.metrics = [_row(summary) for summary in imported.summaries]
    session.add(profile)
    session.flush()
    assert job.result is not None
    # A new document: changes inside of JSON are not noticed.
    job.result.document = {**job.result.document, "profile": paper_figures([profile, *there])}


def _row(summary: Summary) -> ProfileMetric:
    series = summary.series
    return ProfileMetric(
        name=series.name,
        instance=series.instance,
        source=series.source,
        unit=series.unit,
        count=summary.count,
        mean=summary.mean,
        median=summary.median,
        min=summary.min,
        max=summary.max,
        first_time=summary.first_time,
        last_time=summary.last_time,
    )


def _metric_view(metric: ProfileMetric) -> dict[str, Any]:
    names = ("name", "instance", "source", "unit", "count", "mean", "median", "min", "max", "first_time", "last_time")
    return {name: getattr(metric, name) for name in names}


def _identity(profile: Profile) -> tuple[str, str, dict[str, Any] | None]:
    return profile.sha256, profile.format, profile.column_map
