"""The page of devices."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response

from server import device_words
from server.api.device_views import devices_view
from server.api.state import database_of
from server.dashboard.templates import render

router = APIRouter(include_in_schema=False)


@router.get("/devices")
def devices_page(request: Request) -> Response:
    """All devices, and forms to attach more."""
    with database_of(request).reading() as session:
        view = devices_view(session)
    return render(request, "devices.html", {**view, "words": device_words})
