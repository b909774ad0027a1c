"""GET /api/v1/jobs/{id}/frames: every timed frame of a job, as JSON or CSV."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse, Response

from server.api.state import database_of
from server.api.views import find_job
from server.keeping.prune import pruned_at
from server.problems import Problem
from server.series.frames import read_series, series_csv, series_view

router = APIRouter(prefix="/api/v1")


@router.get("/jobs/{job_id}/frames")
def read_frames(
    job_id: str, request: Request, form: Annotated[Literal["json", "csv"], Query(alias="format")] = "json"
) -> Response:
    """A measured job's frames in order: round and index counted from 1, times in ms, null (CSV: empty) if not told.

    Rounds, the median's interval, and a phone's counters frame by frame stand beside them.
    """
    with database_of(request).reading() as session:
        job = find_job(session, job_id)
        if job.result is None:
            raise Problem(409, f"Job {job_id} is {job.state} and has no result: frames come with it.")
        document = job.result.document
    if (day := pruned_at(document, "frames")) is not None:
        raise Problem(410, f"The raw frames of job {job_id} were pruned on {day}; its result stays.")
    series = read_series(document)
    if form == "csv":
        return Response(series_csv(series), media_type="text/csv; charset=utf-8")
    return JSONResponse({"job": int(job_id), "frame_ms": document.get("frame_ms"), **series_view(series)})
