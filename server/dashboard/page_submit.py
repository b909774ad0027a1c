"""A form for a study: one with a name, or a matrix of what is ticked."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from renderer.request import CHECKS, RAYS
from renderer.request import Request as Asked
from renderer.variant import AXES, Variant
from server.api.state import database_of
from server.dashboard.templates import render
from server.devices.registry import PAIRING, ready
from server.live.time_left import write_time
from server.named_studies import STUDIES
from server.scene_list import is_here, list_scenes, require_scene
from server.spoken import spoken
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Study
from server.studies import plan_study
from server.study_axes import SWITCH, write_costs

router = APIRouter(include_in_schema=False)
ON_OFF = {"specialise": tuple(SWITCH)}
"""The axes of a study that are ticked like those of a variant."""


@router.get("/submit")
def submit_page(request: Request) -> Response:
    """A form for a study."""
    with database_of(request).reading() as session:
        devices = known_devices(session)
        studies = [_named(session, name) for name in STUDIES]
    context = {
        "devices": devices,
        "scenes": list_scenes(),
        "axes": AXES | ON_OFF,
        "defaults": Variant().as_dict() | {"specialise": "on"},
        "sah": write_costs(Asked("").costs),
        "studies": studies,
        "rays": RAYS,
        "checks": CHECKS,
    }
    return render(request, "submit.html", context)


def known_devices(session: Session) -> list[dict[str, str]]:
    """The devices that a form offers, each with a word about it."""
    known = session.scalars(select(Device).where(Device.kind != PAIRING).order_by(Device.id)).all()
    devices = [{"id": LLVMPIPE, "detail": "any host that has it"}]
    return devices + [{"id": one.id, "detail": "" if ready(one) else "not ready: jobs wait"} for one in known]


def _named(session: Session, name: str) -> dict[str, Any]:
    """A named study: what it measures, its jobs and slices on one device, and how long the last one took."""
    study = STUDIES[name]
    seconds = _last_took(session, name)
    try:
        planned = plan_study(study, require_scene, is_here)
        size = f"{len(planned.requests)} jobs, {planned.slices} slices on a device"
    except ValueError as error:
        size = spoken(error) or ""
    took = [] if seconds is None else [f"the last one took {write_time(seconds)}"]
    return {"name": name, "text": study.text, "detail": "; ".join([size, *took])}


def _last_took(session: Session, name: str) -> float | None:
    """The seconds from the first start to the last end of the latest study of a name that was measured whole."""
    other = select(Job.id).where(Job.study_id == Study.id, Job.state != "done").exists()
    latest = select(func.max(Study.id)).where(Study.name == name, ~other).scalar_subquery()
    times = select(func.min(Job.started_at), func.max(Job.finished_at)).where(Job.study_id == latest)
    started, finished = session.execute(times).one()
    return None if started is None or finished is None else float((finished - started).total_seconds())
