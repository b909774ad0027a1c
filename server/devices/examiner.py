"""How a device is looked at: a phone over adb, this host's llvmpipe here; the heavy part in a child process."""

from __future__ import annotations

from typing import Any, Protocol

from renderer.child import ChildError
from renderer.locks import device_lock, holding
from server.devices import describe
from server.devices.children import Children
from server.devices.registry import PHONE, TWIN

Json = dict[str, Any]

HEALTH = "server.devices.health"
TIMEOUT_S = 180.0
"""How long a health check may work."""


class UnableError(RuntimeError):
    """A check that this host cannot make, whatever the device; the message is one sentence that says what to do."""


class Examiner(Protocol):
    """Looks at one device. Every method raises DeviceGoneError when it goes away, and PlanError with one sentence."""

    def describe(self) -> Json:
        """Its facts, as far as they are told at once."""

    def condition(self) -> Json:
        """The facts that change while nothing runs; nothing while something runs."""

    def check(self) -> tuple[Json, Json]:
        """The other facts, and its health; raise UnableError when this host cannot check it."""


class PhoneExaminer:
    """Looks at a phone."""

    def __init__(self, serial: str, children: Children) -> None:
        self._serial, self._children = serial, children

    def describe(self) -> Json:
        """Model, SoC, Android, battery, thermal status."""
        return describe.describe_phone(self._serial)

    def condition(self) -> Json:
        """Battery and thermal status; a running measurement is not disturbed."""
        try:
            with holding(device_lock(self._serial), _busy):
                return describe.phone_condition(self._serial)
        except _BusyError:
            return {}

    def check(self) -> tuple[Json, Json]:
        """Driver, limits, precision, and the known scene."""
        return _check(self._children, {"kind": PHONE, "id": self._serial})


class TwinExaminer:
    """Looks at this host's llvmpipe."""

    def __init__(self, children: Children) -> None:
        self._children = children

    def describe(self) -> Json:
        """Processor and memory."""
        return describe.describe_here()

    def condition(self) -> Json:
        """Nothing changes."""
        return {}

    def check(self) -> tuple[Json, Json]:
        """Driver, limits, and the known scene."""
        return _check(self._children, {"kind": TWIN})


class _BusyError(Exception):
    pass


def _busy() -> None:
    raise _BusyError


def _check(children: Children, task: Json) -> tuple[Json, Json]:
    try:
        found = children.run(HEALTH, task, TIMEOUT_S)
    except ChildError as error:
        return {}, {"passed": False, "reason": f"It failed its health check: {error}"}
    if "unable" in found:
        raise UnableError(found["unable"])
    return found["facts"], found["health"]
