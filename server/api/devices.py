"""The API of devices: listing, attaching, pairing, clearing, forgetting."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Request, Response
from pydantic import Field, SecretStr
from sqlalchemy import select
from sqlalchemy.orm import Session

from server.api.bodies import Body, Name
from server.api.device_views import device_url, device_view, devices_view, find_device
from server.api.state import database_of
from server.devices import registry, wanted
from server.devices.address import read_address, read_code
from server.devices.registry import DeviceError
from server.devices.words import plain
from server.problems import Problem
from server.store.models import Worker

router = APIRouter(prefix="/api/v1/devices")


class AttachBody(Body):
    """A network phone, and the host that is to connect to it; by default any host with a worker."""

    address: Name
    host: Name | None = None


class PairBody(Body):
    """A network phone that shows a pairing code, and the host that is to pair with it."""

    address: Name
    code: Annotated[SecretStr, Field(max_length=40)]
    host: Name | None = None


@router.get("")
def list_devices(request: Request) -> dict[str, Any]:
    """All devices, and the pairings that were asked for."""
    with database_of(request).reading() as session:
        return devices_view(session)


@router.get("/{device_id}")
def read_device(device_id: str, request: Request) -> dict[str, Any]:
    """One device, or one pairing."""
    with database_of(request).reading() as session:
        return device_view(session, find_device(session, device_id))


@router.post("", status_code=202)
def attach_device(body: AttachBody, request: Request, response: Response) -> dict[str, Any]:
    """Connect to a network phone, and again whenever it is lost; asking twice is asking once."""
    address = read_address(body.address)
    with database_of(request).writing() as session:
        live = registry.live_hosts(session, lease_of(request))
        host = _known(session, body.host) if body.host else next(iter(live)) if len(live) == 1 else None
        device = wanted.want(session, address, host, live)
        response.headers["Location"] = device_url(device.id)
        session.flush()
        return device_view(session, device)


@router.post("/pair", status_code=202)
def pair_device(body: PairBody, request: Request, response: Response) -> dict[str, Any]:
    """Pair a host with a phone (Android 11 and later); the answer's address tells what came of it."""
    address, code = read_address(body.address), read_code(body.code.get_secret_value())
    with database_of(request).writing() as session:
        live = registry.live_hosts(session, lease_of(request))
        device = wanted.want_pairing(session, address, code, _one_of(live, body.host))
        response.headers["Location"] = device_url(device.id)
        session.flush()
        return device_view(session, device)


@router.post("/{device_id}/clear")
def clear_device(device_id: str, request: Request) -> dict[str, Any]:
    """Put a device that was set aside back to work."""
    with database_of(request).writing() as session:
        device = find_device(session, device_id, for_update=True)
        registry.clear(device)
        session.flush()
        return device_view(session, device)


@router.delete("/{device_id}", status_code=204)
def forget_device(device_id: str, request: Request) -> Response:
    """Disconnect a device and remove it; its results stay."""
    with database_of(request).writing() as session:
        device = find_device(session, device_id, for_update=True)
        try:
            registry.forget(session, device, lease_of(request))
        except DeviceError as error:
            raise Problem(409, str(error)) from error
    return Response(status_code=204)


def lease_of(request: Request) -> float:
    """How long a worker counts as alive after its last sign of life, in seconds."""
    return float(request.app.state.lease_s)


def _known(session: Session, host: str) -> str:
    if session.scalar(select(Worker.id).where(Worker.host == host).limit(1)) is None:
        raise DeviceError(f"No worker ever ran on {plain(host, 80)!r}: start `rayfarm worker` there.")
    return host


def _one_of(live: set[str], host: str | None) -> str:
    """The host that is to pair now."""
    if not live:
        raise Problem(409, "No worker runs that could pair: start `rayfarm worker` where the phone can be reached.")
    if host is None and len(live) == 1:
        return next(iter(live))
    if host not in live:
        raise DeviceError(f"Name the host that is to pair with the phone, one of {', '.join(sorted(live))}.")
    return host
