"""What can be compiled for, and the listings of compiled jobs."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Query, Request
from sqlalchemy.orm import Session

from renderer.phone_compile.gpus import GPUS, USUAL
from renderer.phone_compile.toolchain import MissingError, tool_chain
from server.api.profiles import blobs_of
from server.api.state import database_of
from server.api.views import find_job
from server.compiled.kept import read_listing
from server.problems import Problem
from server.store.blobs import BlobError

router = APIRouter(prefix="/api/v1")
Json = dict[str, Any]


@router.get("/compilers")
def read_compilers() -> Json:
    """The GPUs that a job may be compiled for, and whether this machine has the compilers or how to get them."""
    return {
        "gpus": [{"name": gpu.name, "label": gpu.label, "usual": gpu.name in USUAL} for gpu in GPUS.values()],
        **compilers_here(),
    }


@router.get("/jobs/{job_id}/listing")
def read_job_listing(job_id: str, request: Request, gpu: str = Query(max_length=100)) -> Json:
    """A compiled job's GLSL, and one GPU's disassembly: `weights` say of spans of lines [first, last) how often they
    ran for each run of the program."""
    with database_of(request).reading() as session:
        document = result_of_job(session, job_id)
    return listing_of(request, job_id, document, gpu)


def compilers_here() -> Json:
    """`mesa`, the version of the compilers on this machine or None, and `advice` where they are missing."""
    try:
        return {"mesa": tool_chain().version, "advice": None}
    except MissingError as error:
        return {"mesa": None, "advice": str(error)}


def result_of_job(session: Session, job_id: str) -> Json:
    """A compiled job's result; raise Problem 404 for a job that has none."""
    job = find_job(session, job_id)
    document: Json = (job.result.document if job.result else None) or {}
    if "compiled" not in document:
        raise Problem(404, f"Job {job_id} was not compiled for GPUs, or has no result yet.")
    return document


def listing_of(request: Request, job_id: str, document: Json, gpu: str) -> Json:
    """One GPU's listing of a result; raise Problem 404 where there is none."""
    try:
        listed = read_listing(document, blobs_of(request))
    except BlobError as error:
        raise Problem(503, str(error)) from error
    if listed is None or gpu not in listed["gpus"]:
        raise Problem(404, f"Job {job_id} has no listing for {gpu!r}.")
    return {"job": int(job_id), "gpu": gpu, "glsl": listed["glsl"], **listed["gpus"][gpu]}
