"""What adb says of phones, as the registry shows it: presence, and what to tap or plug."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import Select, or_, select
from sqlalchemy.orm import Session

from server.devices.registry import PHONE
from server.store.models import Device, Presence, now

ONLINE = "device"
"""adb's word for a phone that can be used."""
_UNPLUGGED = "absent"
"""Our word for a phone that adb does not list."""

_USB_GONE = "It is not connected: plug it in, with USB debugging switched on."
_NETWORK_GONE = "It does not answer: switch it on, and Wireless debugging with it; it is connected to again by itself."
_SYSTEM = "Start the phone's own system: it is in its {}."

STATES: dict[str, tuple[Presence, str | None]] = {
    ONLINE: ("online", None),
    "authorizing": ("connecting", None),
    "connecting": ("connecting", None),
    "unauthorized": (
        "unauthorized",
        "Unlock the phone and tap Allow in its question about USB debugging; if it asks nothing, plug it in again.",
    ),
    "offline": ("offline", "It does not answer: unplug it and plug it in again, or switch its debugging off and on."),
    "no": ("offline", "This user may not open it: add a udev rule for it (package android-sdk-platform-tools-common)."),
    "noperm": ("offline", "This user may not open it: add a udev rule for it."),
    "recovery": ("offline", _SYSTEM.format("recovery")),
    "rescue": ("offline", _SYSTEM.format("rescue mode")),
    "sideload": ("offline", _SYSTEM.format("sideload mode")),
    "bootloader": ("offline", _SYSTEM.format("bootloader")),
}
"""adb's states that a phone is shown in; `no permissions` is cut at its first space by adbutils."""


def note_states(session: Session, host: str, states: Mapping[str, str], trouble: str | None = None) -> set[str]:
    """Bring a host's phones in line with what its adb lists (serial to state); return the serials online here.

    A phone that another host has online, or is to connect to, stays that host's. `trouble` is the advice for phones
    that are not listed, when the reason is not theirs.
    """
    known = {d.id: d for d in session.scalars(_concerned(host, states).with_for_update())}
    for serial, state in states.items():
        if state in STATES and _is_ours(known.get(serial), host):
            _show(session, known, serial, host, *_advised(known.get(serial), state))
    for serial, device in known.items():
        waits = device.presence == "connecting" and device.address is not None and trouble is None
        if serial not in states and device.host == host and not waits:
            device.presence, device.advice = _advised(device, _UNPLUGGED, trouble)
    return {s for s, state in states.items() if state == ONLINE and s in known and known[s].host == host}


def _concerned(host: str, states: Mapping[str, str]) -> Select[Device]:
    return select(Device).where(Device.kind == PHONE, or_(Device.host == host, Device.id.in_(list(states))))


def _is_ours(device: Device | None, host: str) -> bool:
    if device is None or device.host in (None, host):
        return True
    return device.presence == "offline" and device.address is None


def _show(
    session: Session, known: dict[str, Device], serial: str, host: str, presence: Presence, advice: str | None
) -> None:
    device = known.get(serial)
    if device is None:
        device = known[serial] = Device(id=serial, kind=PHONE, facts={})
        session.add(device)
    if (device.presence, device.host) != (presence, host):
        device.seen_at = now()
    device.host, device.presence, device.advice = host, presence, advice


def _advised(device: Device | None, state: str, trouble: str | None = None) -> tuple[Presence, str | None]:
    lost = device is not None and device.address is not None
    if state == _UNPLUGGED:
        return "offline", trouble or (_NETWORK_GONE if lost else _USB_GONE)
    if state == "offline" and lost:
        return "offline", _NETWORK_GONE
    return STATES[state]
