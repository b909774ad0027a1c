"""The page that says what went wrong."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import Request
from fastapi.responses import Response

from server.dashboard.templates import TEMPLATES


def error_page(request: Request, status: int, detail: str) -> Response:
    """A page with one sentence."""
    context = {"status": status, "title": HTTPStatus(status).phrase, "detail": detail}
    return TEMPLATES.TemplateResponse(request, "error.html", context, status_code=status)
