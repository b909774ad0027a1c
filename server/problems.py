"""Errors as problem+json (RFC 9457): one clear sentence in `detail`, whatever went wrong."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from server.dashboard.errors import error_page
from server.spoken import spoken
from server.store.errors import AWAY, sentence, shortly

log = logging.getLogger("rayfarm.api")

AGAIN_S = 5


class Problem(HTTPException):
    """A refusal with its status and one sentence."""


class ProblemResponse(JSONResponse):
    """A response of the media type of problems."""

    media_type = "application/problem+json"


def problem(status: int, detail: str, headers: Mapping[str, str] | None = None, **extra: Any) -> ProblemResponse:
    """The problem document of a status and a sentence."""
    title = HTTPStatus(status).phrase
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **extra}
    return ProblemResponse(body, status, dict(headers or {}))


def install(app: FastAPI) -> None:
    """Answer every error of `app` with a problem, or with a page where a browser asks for one."""

    @app.exception_handler(HTTPException)
    def refused(request: Request, error: HTTPException) -> Response:
        return _answer(request, error.status_code, _sentence(request, error), error.headers)

    @app.exception_handler(RequestValidationError)
    def invalid(request: Request, error: RequestValidationError) -> Response:
        status, detail = _explain(error.errors())
        return _answer(request, status, detail)

    def away(request: Request, error: Exception) -> Response:
        log.warning("%s %s was not carried out: %s", request.method, request.url.path, shortly(error))
        return _answer(request, 503, sentence(error), {"Retry-After": str(AGAIN_S)})

    for kind in AWAY:
        app.add_exception_handler(kind, away)

    @app.exception_handler(ValueError)
    def wrong(request: Request, error: ValueError) -> Response:
        said = spoken(error)
        return unexpected(request, error) if said is None else _answer(request, 422, said)

    @app.exception_handler(Exception)
    def unexpected(request: Request, error: Exception) -> Response:
        log.error("%s %s failed", request.method, request.url.path, exc_info=error)
        return _answer(request, 500, "The server failed unexpectedly: its log says why.")


def _answer(request: Request, status: int, detail: str, headers: Mapping[str, str] | None = None) -> Response:
    wants_page = "text/html" in request.headers.get("accept", "") and not request.url.path.startswith("/api/")
    if wants_page:
        return error_page(request, status, detail)
    return problem(status, detail, headers)


def _sentence(request: Request, error: HTTPException) -> str:
    if isinstance(error, Problem):
        return str(error.detail)
    if error.status_code == 404:
        return f"There is nothing at {request.url.path}."
    if error.status_code == 405:
        allowed = (error.headers or {}).get("allow") or (error.headers or {}).get("Allow") or "another method"
        return f"{request.method} is not offered at {request.url.path}: use {allowed}."
    return f"{str(error.detail).rstrip('.')}."


def _explain(errors: Sequence[Any]) -> tuple[int, str]:
    first = errors[0]
    if first["type"] == "json_invalid":
        reason = first.get("ctx", {}).get("error", "not JSON")
        return 400, f"The body is not valid JSON: {str(reason).lower().rstrip('.')}."
    where = ".".join(str(part) for part in first["loc"][1:])
    if first["type"] == "missing" and not where:
        return 422, "The request has no body: send a JSON object."
    if first["type"] == "missing":
        return 422, f"The field {where} is missing."
    if first["type"] == "extra_forbidden":
        return 422, f"There is no field {where}: see /api/v1/openapi.json for those that exist."
    if first["type"] == "literal_error":
        expected = first["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return 422, f"Unknown {where} {str(first['input'])[:80]!r}: choose one of {expected}."
    if first["type"] == "value_error":
        return 422, str(first["ctx"]["error"])
    message = first["msg"][:1].lower() + first["msg"][1:].rstrip(".")
    if not where:
        return 422, f"The body is wrong: {message}; send a JSON object with the content type application/json."
    return 422, f"The field {where} is wrong: {message}."
