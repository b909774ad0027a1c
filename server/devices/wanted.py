"""Network phones and pairings that people asked for: in the registry, and when a host tries them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from datetime import timedelta

from sqlalchemy import delete, or_, select
from sqlalchemy.orm import Session

from server.devices.presence import ONLINE
from server.devices.registry import PAIRING, PHONE, is_ready, no_worker
from server.store.models import Device, now

PAIRING_KEPT = timedelta(minutes=10)
BACK_OFF_S = (1.0, 30.0)
"""The first and the longest wait before a lost phone is tried again."""


def want(session: Session, address: str, host: str | None, live: set[str]) -> Device:
    """Ask that a host, or any, connects to a phone; one that is connected stays as it is."""
    device = session.get(Device, address, with_for_update=True)
    if device is None:
        device = Device(id=address, kind=PHONE, host=host, facts={}, presence="connecting")
        session.add(device)
    if host is None and device.host in live:
        host = device.host
    if host != device.host:
        device.host, device.presence = host, "connecting"
    device.address = address
    if device.presence != "online":
        device.presence = "connecting"
        awaited = device.host in live if device.host else bool(live)
        device.advice = None if awaited else no_worker(device.host)
    return device


def want_pairing(session: Session, address: str, code: str, host: str) -> Device:
    """Ask that a host pairs with a phone; the code is kept until the host takes it."""
    device = session.get(Device, pairing_id(address), with_for_update=True)
    if device is None:
        device = Device(id=pairing_id(address), kind=PAIRING)
        session.add(device)
    device.host, device.presence, device.advice = host, "connecting", None
    device.facts = {"address": address, "code": code}
    device.first_seen_at = device.seen_at = now()
    return device


def pairing_id(address: str) -> str:
    """The id of the row that stands for pairing with an address."""
    return f"pair@{address}"


def take_pairings(session: Session, host: str) -> list[tuple[str, str, str]]:
    """The pairings asked of a host, as (id, address, code): their codes are erased, old answers removed."""
    old = now() - PAIRING_KEPT
    session.execute(delete(Device).where(Device.kind == PAIRING, Device.host == host, Device.seen_at < old))
    rows = session.scalars(select(Device).where(Device.kind == PAIRING, Device.host == host).with_for_update())
    taken = []
    for device in rows:
        if "code" in device.facts:
            taken.append((device.id, device.facts["address"], device.facts["code"]))
            device.facts = {"address": device.facts["address"]}
    return taken


def answer_pairing(session: Session, device_id: str, paired: bool, advice: str) -> None:
    """Tell what a pairing came to: its presence is `online` if it succeeded."""
    device = session.get(Device, device_id, with_for_update=True)
    if device is not None:
        device.presence, device.advice, device.seen_at = "online" if paired else "offline", advice, now()


def answer_attaching(session: Session, address: str, advice: str) -> None:
    """Tell why a phone could not be connected to, unless it has come by itself meanwhile."""
    device = session.get(Device, address, with_for_update=True)
    if device is not None and device.presence in ("connecting", "offline"):
        device.presence, device.advice = "offline", advice


def claim_unclaimed(session: Session, host: str) -> None:
    """Take the network phones that any host may connect to."""
    unclaimed = select(Device).where(Device.kind == PHONE, Device.host.is_(None), Device.address.is_not(None))
    for device in session.scalars(unclaimed.with_for_update(skip_locked=True)):
        device.host, device.advice = host, None


@dataclass(frozen=True)
class Row:
    """What a host polls of one device of its own or of nobody's."""

    id: str
    kind: str
    host: str | None
    address: str | None
    presence: str
    ready: bool


def poll(session: Session, host: str) -> list[Row]:
    """The devices of a host and of nobody, in one query."""
    columns = (Device.id, Device.kind, Device.host, Device.address, Device.presence, is_ready())
    found = session.execute(select(*columns).where(or_(Device.host == host, Device.host.is_(None))))
    return [Row(*values) for values in found]


@dataclass
class Retries:
    """Decides when each wanted address is tried: at once when asked anew, then with back-off."""

    _due: dict[str, float] = field(default_factory=dict)
    _wait: dict[str, float] = field(default_factory=dict)

    def due(
        self, rows: Sequence[Row], states: Mapping[str, str], at: float, busy: AbstractSet[str] = frozenset()
    ) -> list[str]:
        """The addresses to try at a time in seconds; each counts as tried. Those of `busy` are being tried."""
        wanted = {row.address: row for row in rows if row.address is not None and row.kind == PHONE}
        for address in [*self._due]:
            if address not in wanted or states.get(address) in _ATTACHED:
                del self._due[address], self._wait[address]
        chosen = []
        for address, row in wanted.items():
            if states.get(address) in _ATTACHED or address in busy:
                continue
            if row.presence == "connecting" or self._due.setdefault(address, at + BACK_OFF_S[0]) <= at:
                chosen.append(address)
                wait = self._wait[address] = min(2 * self._wait.get(address, BACK_OFF_S[0] / 2), BACK_OFF_S[1])
                self._due[address] = at + wait
            self._wait.setdefault(address, BACK_OFF_S[0])
        return chosen


_ATTACHED = (ONLINE, "unauthorized", "authorizing", "connecting")
