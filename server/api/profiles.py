"""The API of profiles: what profilers wrote while a job ran, imported for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from server.api.state import database_of
from server.api.views import find_job
from server.problems import Problem
from server.profiles.export import metrics_csv
from server.profiles.formats import AUTO, read_map
from server.profiles.store import UNNAMED, find_profile, import_file, job_profiles, profile_view, require_measured
from server.store.blobs import BlobError, Blobs, Incoming
from server.store.database import Database

router = APIRouter(prefix="/api/v1/jobs/{job_id}/profiles")


@router.post("", status_code=201)
async def create_profile(
    job_id: str,
    request: Request,
    name: Annotated[str, Query(description="the file's own name")] = UNNAMED,
    form: Annotated[str, Query(alias="format", description="auto, or the file's format")] = AUTO,
    pairs: Annotated[list[str] | None, Query(alias="map", description="METRIC=COLUMN, once for each")] = None,
) -> Response:
    """Import a profiler's CSV file, the request's body, for a measured job; 200 when it was there already."""
    column_map = read_map(pairs or ())
    database, blobs, most = database_of(request), blobs_of(request), _most_of(request)
    _refuse_form(request)
    await run_in_threadpool(_require_measured, database, job_id)
    with _blobs_told(), blobs.receiving() as incoming:
        await _receive(request, incoming, most)
        view, new = await run_in_threadpool(import_file, database, blobs, incoming, job_id, name, form, column_map)
    return JSONResponse(view, 201 if new else 200, {"Location": view["url"]})


@router.get("")
def list_profiles(
    job_id: str, request: Request, form: Annotated[Literal["json", "csv"], Query(alias="format")] = "json"
) -> Response:
    """A job's profiles, the latest import first; `format=csv` gives all their metrics, a line a series."""
    with database_of(request).reading() as session:
        profiles = job_profiles(session, find_job(session, job_id))
        if form == "csv":
            return Response(metrics_csv(profiles), media_type="text/csv; charset=utf-8")
        return JSONResponse({"profiles": [profile_view(profile, with_metrics=False) for profile in profiles]})


@router.get("/{profile_id}")
def read_profile(job_id: str, profile_id: str, request: Request) -> dict[str, Any]:
    """One profile with its metrics."""
    with database_of(request).reading() as session:
        return profile_view(find_profile(session, job_id, profile_id), with_metrics=True)


@router.get("/{profile_id}/file")
def read_file(job_id: str, profile_id: str, request: Request) -> Response:
    """The file as it was imported, byte for byte."""
    with database_of(request).reading() as session:
        profile = find_profile(session, job_id, profile_id)
    if profile.pruned_at is not None:
        day = profile.pruned_at.date()
        raise Problem(
            410, f"The text of this profile was pruned on {day}; its metrics stay: import it again for its text."
        )
    headers = {
        "Content-Disposition": f"attachment; filename*=UTF-8''{quote(profile.file_name, safe='')}",
        "Content-Length": str(profile.size),
    }
    with _blobs_told():
        content = blobs_of(request).read(profile.sha256)
    return StreamingResponse(content, media_type="text/csv", headers=headers)


def blobs_of(request: Request) -> Blobs:
    """The blobs of the app that a request came to."""
    blobs = request.app.state.blobs
    assert isinstance(blobs, Blobs)
    return blobs


async def _receive(request: Request, incoming: Incoming, most: int) -> None:
    try:
        async for chunk in request.stream():
            if incoming.size + len(chunk) > most:
                raise Problem(413, f"The file has more than {most // 10**6} MB: split it, or raise RAYFARM_PROFILE_MB.")
            incoming.write(chunk)
    except ClientDisconnect as error:
        raise Problem(400, "The connection ended before the file did: send it again.") from error


@contextmanager
def _blobs_told() -> Iterator[None]:
    try:
        yield
    except BlobError as error:
        raise Problem(503, str(error)) from error


def _most_of(request: Request) -> int:
    """The largest file that is taken, in bytes."""
    return int(request.app.state.profile_mb) * 10**6


def _require_measured(database: Database, job_id: str) -> None:
    with database.reading() as session:
        require_measured(session, job_id)


def _refuse_form(request: Request) -> None:
    if request.headers.get("content-type", "").startswith("multipart/"):
        raise Problem(415, "Send the file itself as the body (curl --data-binary @FILE), not as a form.")
