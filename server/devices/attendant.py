"""Looks after one device while it is there: describes it, checks its health, and says when jobs may run on it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy.exc import SQLAlchemyError

from renderer.host import DeviceGoneError
from renderer.plan import PlanError
from server.devices import registry
from server.devices.children import Ended
from server.devices.examiner import Examiner, UnableError
from server.logs import facts
from server.store.database import Database
from server.store.models import Device, Json, now

log = logging.getLogger("rayfarm.devices")


@dataclass(frozen=True)
class Pace:
    """Seconds between looks at an idle device, between health checks, and before a failed look is repeated."""

    condition_s: float = 60.0
    health_s: float = 86_400.0
    again_s: float = 30.0


class Attendant:
    """A thread for one device, from its arrival to `leave`."""

    def __init__(
        self,
        database: Database,
        device_id: str,
        examiner: Examiner,
        on_ready: Callable[[str], None],
        pace: Pace,
        after: Attendant | None = None,
    ) -> None:
        """`after` is the one who looked after the device before: this one begins at its end."""
        self.device_id, self.told = device_id, False
        self._named = facts(device=device_id)
        self._database, self._examiner, self._on_ready, self._pace = database, examiner, on_ready, pace
        self._after = after
        self._left, self._wake = threading.Event(), threading.Event()
        self._described = self._advised = False
        self._thread = threading.Thread(target=self._run, name=f"device {device_id}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    @property
    def left(self) -> bool:
        """Whether it was told to end."""
        return self._left.is_set()

    def look(self) -> None:
        """Look at the device now rather than later."""
        self._wake.set()

    def leave(self) -> None:
        """End soon; what is being done is finished, and written down where it still can be."""
        self._left.set()
        self._wake.set()

    def join(self, timeout_s: float | None = None) -> None:
        """Wait for the end, or for so long."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        if self._after is not None:
            self._after.join()
            self._after = None
        while not self._left.is_set():
            self._wake.clear()
            wait_s = self._pace.condition_s if self._look() else self._pace.again_s
            self._wake.wait(wait_s)

    def _look(self) -> bool:
        """Do what is due; False when it is to be done again soon."""
        try:
            self._describe()
            self._tell_if_ready()
            self._check_if_due()
            self._tell_if_ready()
            self._advise(None)
        except (DeviceGoneError, Ended):
            return False
        except (PlanError, UnableError) as error:
            log.warning("%s", error, extra=self._named)
            self._advise(str(error))
            return False
        except SQLAlchemyError as error:
            log.warning("the database does not answer: %s", type(error).__name__, extra=self._named)
            return False
        except Exception:
            log.exception("the device could not be looked at", extra=self._named)
            return False
        return True

    def _describe(self) -> None:
        facts = self._examiner.condition() if self._described else self._examiner.describe()
        with self._database.writing() as session:
            device = session.get(Device, self.device_id, with_for_update=True)
            if device is not None and _was_updated(device.facts, facts):
                device.health_at = None
            registry.record_facts(session, self.device_id, facts)
        self._described = True

    def _check_if_due(self) -> None:
        if self._left.is_set() or not self._is_due():
            return
        facts, health = self._examiner.check()
        with self._database.writing() as session:
            registry.record_facts(session, self.device_id, facts)
            registry.record_health(session, self.device_id, health)
        if not health["passed"]:
            log.warning("set aside: %s", health["reason"], extra=self._named)

    def _is_due(self) -> bool:
        with self._database.reading() as session:
            device = session.get(Device, self.device_id)
            if device is None or device.set_aside is not None:
                return False
            return device.health_at is None or device.health_at < now() - timedelta(seconds=self._pace.health_s)

    def _tell_if_ready(self) -> None:
        """Once for each time that it becomes ready."""
        with self._database.reading() as session:
            device = session.get(Device, self.device_id)
            is_ready = device is not None and registry.ready(device)
        if is_ready and not self.told and not self._left.is_set():
            log.info("ready", extra=self._named)
            self._on_ready(self.device_id)
        self.told = is_ready

    def _advise(self, sentence: str | None) -> None:
        """Show why a device that is there cannot be looked at, or no longer."""
        if sentence is None and not self._advised:
            return
        self._advised = sentence is not None
        try:
            with self._database.writing() as session:
                device = session.get(Device, self.device_id, with_for_update=True)
                if device is not None and device.presence == "online":
                    device.advice = sentence
        except SQLAlchemyError:
            log.warning("the database does not answer", extra=self._named)


def _was_updated(known: Json, told: Json) -> bool:
    """Whether the phone's system is another than when it was checked."""
    before, after = known.get("fingerprint"), told.get("fingerprint")
    return before is not None and after is not None and before != after
