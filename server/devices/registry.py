"""The registry of devices in the store: when jobs may run on one, and what people ask of one.

Every function works in the caller's transaction.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Any

from sqlalchemy import ColumnElement, and_, delete, or_, select
from sqlalchemy.orm import Session

from server.devices.words import plain
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Json, Worker, now
from server.store.states import OPEN

TWIN, PHONE, PAIRING = "twin", "phone", "pairing"
"""Kinds of devices; a pairing is a request that a host pairs with a phone, kept among them until it is answered."""


class DeviceError(ValueError):
    """Something that cannot be asked of a device; the message is one sentence that says what to do."""


def ready(device: Device) -> bool:
    """Whether jobs may run on a device: it is there, not set aside, and a phone's health was found good or cleared."""
    health = device.health or {}
    checked = device.kind == TWIN or (device.kind == PHONE and bool(health.get("passed") or health.get("cleared")))
    return device.presence == "online" and device.set_aside is None and checked


def is_ready() -> ColumnElement[bool]:
    """`ready` as a condition on `Device`."""
    passed = or_(*(Device.health[word].as_boolean().is_(True) for word in ("passed", "cleared")))
    checked = or_(Device.kind == TWIN, and_(Device.kind == PHONE, passed))
    return and_(Device.presence == "online", Device.set_aside.is_(None), checked)


def twin_id(host: str) -> str:
    """The id of a host's llvmpipe."""
    return f"{LLVMPIPE}@{host}"


def see_twin(session: Session, host: str) -> None:
    """Show a host's llvmpipe as online."""
    device = _locked(session, twin_id(host))
    if device is None:
        device = Device(id=twin_id(host), kind=TWIN, host=host)
        session.add(device)
    device.host, device.presence, device.advice, device.seen_at = host, "online", None, now()


def record_facts(session: Session, device_id: str, facts: Json) -> None:
    """Add to what a device told about itself; one that was forgotten meanwhile stays so."""
    device = _locked(session, device_id)
    if device is not None:
        device.facts, device.seen_at = device.facts | facts, now()


def record_health(session: Session, device_id: str, health: Json) -> None:
    """Keep the outcome of a health check; a failed one sets the device aside."""
    device = _locked(session, device_id)
    if device is None:
        return
    reason = None if health["passed"] else plain(health["reason"], 400)
    device.health, device.health_at = health | {"reason": reason}, now()
    device.set_aside = device.set_aside or reason


def clear(device: Device) -> None:
    """Put a device that was set aside back to work, until a later check finds it wanting again."""
    if device.set_aside is not None:
        device.set_aside, device.health = None, (device.health or {}) | {"cleared": True}


def forget(session: Session, device: Device, lease_s: float) -> None:
    """Remove a device; raise DeviceError while it is in use or would come back by itself.

    Its host disconnects a network phone whose row is gone.
    """
    count = len(session.scalars(select(Job.id).where(Job.device == device.id, Job.state.in_(OPEN))).all())
    if count:
        jobs = "job is" if count == 1 else "jobs are"
        raise DeviceError(f"{count} {jobs} still open on {device.id}: cancel them, or wait for their end.")
    watched = device.presence == "online" and device.host in live_hosts(session, lease_s)
    if watched and device.kind == TWIN:
        raise DeviceError(f"{device.id} is there as long as a worker runs on {device.host}: end that first.")
    if watched and device.kind == PHONE and device.address is None:
        raise DeviceError(f"{device.id} is connected to {device.host} and would come back: unplug it first.")
    session.delete(device)


def host_gone(session: Session, host: str) -> None:
    """Show the devices of a host that has no live worker as offline; nothing where it has one after all.

    A worker may have come, and shown them, since the caller looked: it would not show them again.
    """
    shown = select(Device).where(Device.host == host, Device.kind != PAIRING)
    devices = session.scalars(shown.with_for_update()).all()
    if host in held_hosts(session):
        return
    session.execute(delete(Device).where(Device.host == host, Device.kind == PAIRING))
    for device in devices:
        if device.presence != "offline":
            device.presence, device.advice = "offline", no_worker(host)


def no_worker(host: str | None) -> str:
    """What to do about a host without a worker."""
    return f"No worker runs on {host}: start `rayfarm worker` there." if host else "Start `rayfarm worker` on its host."


def live_hosts(session: Session, lease_s: float) -> set[str]:
    """The hosts with a worker that gave a sign of life in the last `lease_s` seconds."""
    since = now() - timedelta(seconds=lease_s)
    alive = (Worker.ended_at.is_(None), Worker.reaped_at.is_(None), Worker.beat_at > since)
    return set(session.scalars(select(Worker.host).where(*alive)))


def held_hosts(session: Session) -> set[str]:
    """The hosts with a worker that nobody has given up."""
    return set(session.scalars(select(Worker.host).where(Worker.ended_at.is_(None), Worker.reaped_at.is_(None))))


def find(session: Session, device_id: str, **options: Any) -> Device | None:
    """A device by id; None when there is none, or its row stands for a pairing."""
    device = session.get(Device, device_id, **options)
    return None if device is None or device.kind == PAIRING else device


def _locked(session: Session, device_id: str) -> Device | None:
    return session.get(Device, device_id, with_for_update=True)
