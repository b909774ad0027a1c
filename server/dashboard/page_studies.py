"""The latest studies, and one study."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select

from renderer.variant import AXES, Variant
from server.api.events import feed_of
from server.api.state import database_of
from server.api.study_views import study_lines, study_view
from server.api.views import find_study, job_line, job_lines
from server.dashboard.templates import render
from server.named_studies import SPECIALISE
from server.store.models import Job, Study
from server.store.states import OPEN

router = APIRouter(include_in_schema=False)
SHOWN = 25
MANY = 60
"""More jobs than this are shown by scene, each scene's folded up."""
REPORTED = "paper"
"""The study that has a report."""

Json = dict[str, Any]


@router.get("/studies")
def studies_page(request: Request) -> Response:
    """The latest studies, and the latest jobs."""
    with database_of(request).reading() as session:
        studies = session.scalars(select(Study).order_by(Study.id.desc()).limit(SHOWN)).all()
        jobs = session.scalars(job_lines().order_by(Job.id.desc()).limit(SHOWN)).all()
        context = {"studies": study_lines(session, studies), "jobs": [job_line(job) for job in jobs]}
    return render(request, "studies.html", context)


@router.get("/studies/{study_id}")
def study_page(study_id: str, request: Request) -> Response:
    """One study and its progress."""
    after = feed_of(request).settled()  # Asked first: what the page does not show then comes as an event.
    with database_of(request).reading() as session:
        study = study_view(session, find_study(session, study_id))
    context = {
        "study": study,
        "groups": _by_scene(study["jobs"]) if len(study["jobs"]) > MANY else None,
        "settings": [key for key in ("size", "sah") if len({job[key] for job in study["jobs"]}) > 1],
        "reported": study["name"] == REPORTED,
        "halves": _halves(study["id"]) if study["name"] == SPECIALISE else "",
        "left_out": _left_out(study["refused"]),
        "after": after,
        "open_states": OPEN,
    }
    return render(request, "study.html", context)


def _halves(study_id: int) -> str:
    """Where the specialised half of a study is held against the general one."""
    sides = {"baseline": f"study:{study_id},specialise=off", "against": f"study:{study_id},specialise=on"}
    return f"/difference?{urlencode(sides)}"


def _left_out(refused: Sequence[Json]) -> dict[str, list[str]]:
    """What was left out, by the reason."""
    groups: dict[str, list[str]] = defaultdict(list)
    for item in refused:
        variant = Variant(**{axis: item[axis] for axis in AXES if axis in item})
        groups[item["reason"]].append(f"{variant.label} on {item['scene']}" if item["scene"] else variant.label)
    return dict(groups)


def _by_scene(jobs: Sequence[Json]) -> list[tuple[str, list[Json], int]]:
    """Each scene with its jobs, and how many of them are over."""
    groups: dict[str, list[Json]] = defaultdict(list)
    for job in jobs:
        groups[job["scene"]].append(job)
    return [(scene, own, sum(job["state"] not in OPEN for job in own)) for scene, own in groups.items()]
