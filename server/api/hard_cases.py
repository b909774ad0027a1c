"""The API of hard cases: studies that were run by `rayfarm study hard-cases` and handed in whole."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from server.api.state import database_of
from server.comparison.flat import csv_lines
from server.hard_cases.document import Document
from server.hard_cases.export import cell_rows, columns_of
from server.hard_cases.store import find_run, keep_run, list_runs, run_line
from server.problems import Problem

router = APIRouter(prefix="/api/v1/hard-cases")
MOST_BYTES = 64 * 10**6
SHOWN = 200


@router.post("", status_code=201)
async def create_run(request: Request) -> Response:
    """Keep a study's document, the request's body as `study hard-cases --output` writes it; 200 when it was here."""
    body = await _receive(request)
    line, new = await run_in_threadpool(lambda: keep_run(database_of(request), _read(body)))
    return JSONResponse(line, 201 if new else 200, {"Location": line["url"]})


@router.get("")
def read_runs(request: Request) -> dict[str, Any]:
    """The latest runs, each with its environment, its seed and the promises it kept."""
    with database_of(request).reading() as session:
        return {"runs": list_runs(session, SHOWN)}


@router.get("/{run_id}")
def read_run(
    run_id: str, request: Request, form: Annotated[Literal["json", "csv"], Query(alias="format")] = "json"
) -> Response:
    """One run with its whole document; `format=csv` gives its cells, a line each."""
    with database_of(request).reading() as session:
        run = find_run(session, run_id)
    if form == "csv":
        text = "".join(csv_lines(cell_rows(run.document), columns=columns_of(run.document)))
        headers = {"Content-Disposition": f'attachment; filename="rayfarm-hard-cases-{run.id}.csv"'}
        return Response(text, media_type="text/csv; charset=utf-8", headers=headers)
    return JSONResponse(run_line(run) | {"document": run.document})


def _read(body: bytes) -> Document:
    try:
        return Document.model_validate_json(body)
    except ValidationError as error:
        # The service's own words for what is wrong with a body.
        details = [detail | {"loc": ("body", *detail["loc"])} for detail in error.errors()]
        raise RequestValidationError(details) from error


async def _receive(request: Request) -> bytes:
    body = bytearray()
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > MOST_BYTES:
                raise Problem(
                    413, f"The document has more than {MOST_BYTES // 10**6} MB: run fewer traversals a study."
                )
    except ClientDisconnect as error:
        raise Problem(400, "The connection ended before the document did: send it again.") from error
    return bytes(body)
