"""The pages' addresses: a router for each subject, the static files, and plotly.js from its wheel."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from fastapi import APIRouter, FastAPI
from fastapi.responses import FileResponse, Response
from fastapi.staticfiles import StaticFiles

from server.dashboard import (
    page_compare,
    page_compile,
    page_devices,
    page_difference,
    page_hard_cases,
    page_job,
    page_login,
    page_pictures,
    page_predictors,
    page_recommend,
    page_report,
    page_scenes,
    page_studies,
    page_submit,
)
from server.dashboard.templates import FOLDER

router = APIRouter(include_in_schema=False)


def install(app: FastAPI) -> None:
    """Add the pages and their static files to an application."""
    for page in (
        page_compare,
        page_compile,
        page_difference,
        page_studies,
        page_report,
        page_hard_cases,
        page_job,
        page_login,
        page_submit,
        page_devices,
        page_pictures,
        page_predictors,
        page_recommend,
        page_scenes,
    ):
        app.include_router(page.router)
    app.include_router(router)
    app.mount("/static", StaticFiles(directory=FOLDER / "static"), name="static")


@router.get("/plotly.min.js")
def plotly_script() -> Response:
    """plotly.js as its wheel has it."""
    return FileResponse(_plotly_path(), media_type="text/javascript", headers={"Cache-Control": "max-age=86400"})


def _plotly_path() -> Path:
    spec = find_spec("plotly")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent / "package_data" / "plotly.min.js"
