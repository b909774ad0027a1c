"""One job."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response
from sqlalchemy.orm import Session

from renderer.phone_compile.listing import KINDS
from server.api.state import database_of
from server.api.views import find_job, job_view
from server.comparison.flat import without_raw
from server.dashboard.fields import metric_rows, result_fields
from server.dashboard.headline import headline, paper_lines
from server.dashboard.page_compile import compiled_rows
from server.dashboard.result_words import asked_words, environment, left_out
from server.dashboard.templates import render
from server.dashboard.waiting import body_again, wait_of
from server.keeping.prune import pruned_at
from server.profiles.formats import FORMATS
from server.profiles.store import job_profiles, profile_view
from server.recommendations import asked_of
from server.series.frames import Series, read_series
from server.store.models import Job, Profile
from server.store.states import OPEN

router = APIRouter(include_in_schema=False)
Json = dict[str, Any]

SHOWN = 500
"""How many frames, and metrics of a profile, the page's tables have; the CSVs have all."""


@router.get("/jobs/{job_id}")
def job_page(job_id: str, request: Request) -> Response:
    """One job: what it waits for, its history, what it measured, its frames and profiles."""
    with database_of(request).reading() as session:
        found = find_job(session, job_id)
        job = job_view(found)
        if asked_of(found.request) is not None:
            return RedirectResponse(job["page"], 303)
        context = {
            "job": job,
            "after": max((change.id for change in found.changes), default=0),
            "open_states": OPEN,
            "asked": asked_words(found.request),
            "wait": wait_of(session, found, request.app.state.lease_s),
            "again": body_again(found),
            "profile_mb": request.app.state.profile_mb,
            "kind_names": KINDS,
            **_result_context(session, found, job["result"]),
        }
    return render(request, "job.html", context)


def _result_context(session: Session, job: Job, document: Json | None) -> Json:
    """What a measured job shows."""
    if document is None:
        return {"measured": False, "compiled": []}
    return {
        "measured": True,
        "headline": headline(document, job.request),
        "compiled": compiled_rows(session, document, job.id) if "compiled" in document else [],
        "environment": environment(document),
        "left_out": left_out(document),
        "pruned": {what: pruned_at(document, what) for what in ("frames", "files")},
        "pictures": {"image": None, "counts": None} | (document.get("pictures") or {}),
        "fields": result_fields(without_raw(document)),
        "series": _series_context(read_series(document)),
        "profiles": _profile_views(job_profiles(session, job)),
        "paper": paper_lines(document.get("profile") or {}),
        "formats": {name: form.label for name, form in FORMATS.items()},
    }


def _series_context(series: Series) -> Json:
    frames = series.frames[:SHOWN]
    return {
        "rounds": series.rounds,
        "readings": series.readings,
        "unavailable": series.unavailable,
        "frames": [(frame, [reading.values[i] for reading in series.readings]) for i, frame in enumerate(frames)],
        "total": len(series.frames),
        "throttled": [one.number for one in series.rounds if one.throttled],
    }


def _profile_views(profiles: Sequence[Profile]) -> list[Json]:
    views = [profile_view(profile, with_metrics=True) for profile in profiles]
    return [view | {"total": len(view["metrics"]), "metrics": metric_rows(view["metrics"][:SHOWN])} for view in views]
