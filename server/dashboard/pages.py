"""The pages' addresses."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import FileResponse, Response
from fastapi.staticfiles import StaticFiles
from sqlalchemy import select

from renderer.request import CHECKS, RAYS
from renderer.variant import AXES, Variant
from server.api import database_of
from server.api_events import feed_of
from server.dashboard import pages_devices
from server.dashboard.context import comparison_context
from server.dashboard.fields import result_fields
from server.dashboard.templates import FOLDER, TEMPLATES
from server.devices.registry import PAIRING, ready
from server.scene_list import list_scenes
from server.selection import known_values, load_comparison, read_selection
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Study
from server.store.states import OPEN
from server.studies import STUDIES
from server.views import find_job, find_study, job_line, job_lines, job_view, study_lines, study_view

router = APIRouter(include_in_schema=False)
SHOWN = 50


def install(app: FastAPI) -> None:
    """Add the pages and their static files to an application."""
    app.include_router(router)
    app.include_router(pages_devices.router)
    app.mount("/static", StaticFiles(directory=FOLDER / "static"), name="static")


@router.get("/")
def comparison_page(request: Request) -> Response:
    """The comparison; the query string is its whole state."""
    selection = read_selection(request.query_params)
    database = database_of(request)
    table = load_comparison(database, selection)
    with database.reading() as session:
        recent = select(Study.id, Study.name).order_by(Study.id.desc()).limit(SHOWN)
        studies = [(number, name) for number, name in session.execute(recent)]
    return _page(request, "compare.html", comparison_context(table, selection, known_values(database), studies))


@router.get("/studies")
def studies_page(request: Request) -> Response:
    """The latest studies, and the latest jobs."""
    with database_of(request).reading() as session:
        studies = session.scalars(select(Study).order_by(Study.id.desc()).limit(SHOWN)).all()
        jobs = session.scalars(job_lines().order_by(Job.id.desc()).limit(SHOWN)).all()
        context = {"studies": study_lines(session, studies), "jobs": [job_line(job) for job in jobs]}
    return _page(request, "studies.html", context)


@router.get("/studies/{study_id}")
def study_page(study_id: str, request: Request) -> Response:
    """One study and its progress."""
    after = feed_of(request).settled()  # Asked first: what the page does not show then comes as an event.
    with database_of(request).reading() as session:
        study = study_view(session, find_study(session, study_id))
    return _page(request, "study.html", {"study": study, "after": after, "open_states": OPEN})


@router.get("/jobs/{job_id}")
def job_page(job_id: str, request: Request) -> Response:
    """One job: state, history, result."""
    with database_of(request).reading() as session:
        found = find_job(session, job_id)
        job, after = job_view(found), max((change.id for change in found.changes), default=0)
    fields = result_fields(job["result"]) if job["result"] else []
    return _page(request, "job.html", {"job": job, "fields": fields, "after": after, "open_states": OPEN})


@router.get("/submit")
def submit_page(request: Request) -> Response:
    """A form for a study."""
    with database_of(request).reading() as session:
        known = session.scalars(select(Device).where(Device.kind != PAIRING).order_by(Device.id)).all()
        devices = [{"id": LLVMPIPE, "detail": "any host that has it"}]
        devices += [{"id": device.id, "detail": "" if ready(device) else "not ready: jobs wait"} for device in known]
    context = {
        "devices": devices,
        "scenes": list_scenes(),
        "axes": AXES,
        "defaults": Variant().as_dict(),
        "studies": STUDIES,
        "rays": RAYS,
        "checks": CHECKS,
    }
    return _page(request, "submit.html", context)


@router.get("/plotly.min.js")
def plotly_script() -> Response:
    """plotly.js as its wheel has it."""
    return FileResponse(_plotly_path(), media_type="text/javascript", headers={"Cache-Control": "max-age=86400"})


def _page(request: Request, name: str, context: dict[str, Any]) -> Response:
    return TEMPLATES.TemplateResponse(request, name, {**context, "path": request.url.path})


def _plotly_path() -> Path:
    spec = find_spec("plotly")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"
