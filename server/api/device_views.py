"""Devices as the API and the page show them."""

from __future__ import annotations

from collections import defaultdict
from typing import Any
from urllib.parse import quote

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.devices import registry
from server.problems import Problem
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Slice, Worker
from server.store.states import HELD, OPEN

Json = dict[str, Any]


def device_url(device_id: str) -> str:
    """The address of a device."""
    return f"/api/v1/devices/{quote(device_id, safe=':@')}"


def find_device(session: Session, device_id: str, *, for_update: bool = False) -> Device:
    """A device by the id in a path, its row locked if it will be changed; raise Problem 404 when there is none."""
    device = session.get(Device, device_id, with_for_update=for_update or None) if len(device_id) <= 200 else None
    if device is None:
        raise Problem(404, f"There is no device {device_id[:80]!r}: GET /api/v1/devices lists them.")
    return device


def devices_view(session: Session) -> Json:
    """All devices, those that are there first, and the pairings that were asked for."""
    devices = session.scalars(select(Device)).all()
    shown = [device for device in devices if device.kind != registry.PAIRING]
    shown.sort(key=lambda device: (device.presence != "online", device.kind, device.id))
    running, waiting = _running(session), _open(session)
    return {
        "devices": [_view(device, running, waiting) for device in shown],
        "pairings": [pairing_view(device) for device in devices if device.kind == registry.PAIRING],
    }


def device_view(session: Session, device: Device) -> Json:
    """One device, or one pairing."""
    if device.kind == registry.PAIRING:
        return pairing_view(device)
    return _view(device, _running(session), _open(session))


def pairing_view(device: Device) -> Json:
    """A pairing: what came of it is in `advice`, once its presence is no longer `connecting`."""
    return {
        "id": device.id,
        "kind": device.kind,
        "host": device.host,
        "address": device.facts.get("address"),
        "presence": device.presence,
        "advice": device.advice,
        "url": device_url(device.id),
    }


def _view(device: Device, running: dict[str, list[Json]], waiting: dict[str, int]) -> Json:
    return {
        "id": device.id,
        "kind": device.kind,
        "name": device.facts.get("name"),
        "host": device.host,
        "address": device.address,
        "presence": device.presence,
        "advice": device.advice,
        "ready": registry.ready(device),
        "set_aside": device.set_aside,
        "facts": device.facts,
        "health": device.health,
        "health_at": device.health_at and device.health_at.isoformat(timespec="milliseconds"),
        "running": running.get(device.id, []),
        "open_jobs": waiting.get(device.id, 0),
        "first_seen_at": device.first_seen_at.isoformat(timespec="milliseconds"),
        "seen_at": device.seen_at.isoformat(timespec="milliseconds"),
        "url": device_url(device.id),
    }


def _running(session: Session) -> dict[str, list[Json]]:
    """What runs on each device now; a pool's job on the llvmpipe of the host whose worker holds it."""
    held = (
        select(Job.id, Job.scene, Job.label, Slice.state, Job.device, Worker.host)
        .join(Slice, Slice.job_id == Job.id)
        .join(Worker, Worker.id == Slice.worker, isouter=True)
        .where(Slice.state.in_(HELD))
        .order_by(Job.id)
    )
    found = defaultdict(list)
    for number, scene, label, state, device, host in session.execute(held):
        key = registry.twin_id(host) if device == LLVMPIPE and host is not None else device
        found[key].append({"job": number, "scene": scene, "variant": label, "state": state, "page": f"/jobs/{number}"})
    return found


def _open(session: Session) -> dict[str, int]:
    """How many jobs that name each device are not at their end."""
    counted = select(Job.device, func.count()).where(Job.state.in_(OPEN)).group_by(Job.device)
    return dict(session.execute(counted).all())
