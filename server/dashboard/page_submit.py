"""A form for a study."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select

from renderer.request import CHECKS, RAYS
from renderer.variant import AXES, Variant
from server.api.state import database_of
from server.dashboard.templates import render
from server.devices.registry import PAIRING, ready
from server.scene_list import list_scenes
from server.store.defaults import LLVMPIPE
from server.store.models import Device
from server.studies import STUDIES

router = APIRouter(include_in_schema=False)


@router.get("/submit")
def submitrender(request: Request) -> Response:
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
    return render(request, "submit.html", context)
