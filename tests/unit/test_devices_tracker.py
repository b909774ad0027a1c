"""The tracker as a state machine: fakes for adb, for connecting, and for the look at a device."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from adbutils import DeviceEvent
from sqlalchemy.exc import OperationalError
from test_devices_hotplug import FakeAdb

from renderer.host import DeviceGoneError
from renderer.plan import PlanError
from server.devices import registry, tracker, wanted
from server.devices.attach import AttachError
from server.devices.attendant import Pace
from server.devices.examiner import UnableError
from server.devices.presence import note_states
from server.devices.tracker import Tracker
from server.store.database import Database
from server.store.models import Device

GOOD = {"passed": True, "reason": None}
BAD = {"passed": False, "reason": "3 false hits in cornell-box."}
PHONE = "h:5555"


class FakeExaminer:
    """What a look at a device comes to; an exception is raised."""

    def __init__(self) -> None:
        self.described: Any = {"name": "Phone"}
        self.health: Any = GOOD
        self.checks = 0
        self.may_check = threading.Event()
        self.may_check.set()

    def describe(self) -> dict[str, Any]:
        told: dict[str, Any] = _give(self.described)
        return told

    def condition(self) -> dict[str, Any]:
        return {"battery": {"level": 50}}

    def check(self) -> tuple[dict[str, Any], dict[str, Any]]:
        assert self.may_check.wait(10)
        self.checks += 1
        return {"gl": {"renderer": "GPU"}}, _give(self.health)


class FakeLinks:
    """Connects to whom it is told to; notes what it was asked."""

    def __init__(self, adb: FakeAdb) -> None:
        self.adb, self.asked, self.answers = adb, list[str](), dict[str, Any]()

    def connect(self, address: str) -> None:
        self.asked.append(f"connect {address}")
        _give(self.answers.get(address, {}))
        attach(self.adb, address)

    def disconnect(self, address: str) -> None:
        self.asked.append(f"disconnect {address}")
        detach(self.adb, address)

    def pair(self, address: str, code: str) -> None:
        self.asked.append(f"pair {address} {code}")
        _give(self.answers.get(address, {}))


class Farm:
    def __init__(self, database: Database) -> None:
        self.database, self.adb, self.examiner = database, FakeAdb(), FakeExaminer()
        self.links = FakeLinks(self.adb)
        self.ready: queue.Queue[str] = queue.Queue()
        self.pace = Pace(condition_s=60.0, again_s=0.05)

    @contextmanager
    def tracked(self, host: str = "here", twin: bool = False) -> Iterator[Tracker]:
        fakes: dict[str, Any] = {"adb": self.adb, "links": self.links, "examiner": lambda _id: self.examiner}
        one = Tracker(self.database, host, self.ready.put, twin=twin, pace=self.pace, **fakes)
        one.start()
        try:
            yield one
        finally:
            one.stop()

    def device(self, device_id: str = PHONE) -> Device | None:
        with self.database.reading() as session:
            return session.get(Device, device_id)

    def wait(self, holds: Callable[[Device], object], device_id: str = PHONE) -> Device:
        deadline = time.monotonic() + 10
        while True:
            device = self.device(device_id)
            if device is not None and holds(device):
                return device
            assert time.monotonic() < deadline, device and (device.presence, device.advice, device.health)
            time.sleep(0.01)

    def want(self, address: str = PHONE) -> None:
        with self.database.writing() as session:
            wanted.want(session, address, "here", {"here"})


def attach(adb: FakeAdb, serial: str, state: str = "device") -> None:
    assert isinstance(adb.now, dict)
    adb.set({**adb.now, serial: state}, DeviceEvent(True, serial, state))


def detach(adb: FakeAdb, serial: str) -> None:
    assert isinstance(adb.now, dict)
    left = {key: value for key, value in adb.now.items() if key != serial}
    adb.set(left, DeviceEvent(False, serial, "absent"))


def _give(value: Any) -> Any:
    if isinstance(value, Exception):
        raise value
    return value


@pytest.fixture
def farm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Farm]:
    monkeypatch.setattr(tracker, "POLL_S", 0.05)
    monkeypatch.setattr(wanted, "BACK_OFF_S", (0.05, 0.2))
    database = Database(f"sqlite:///{tmp_path / 'farm.sqlite'}")
    yield Farm(database)
    database.close()


def test_a_phone_is_described_checked_and_ready(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, PHONE)
        assert farm.ready.get(timeout=10) == PHONE
        device = farm.wait(registry.ready)
    assert device.facts == {"name": "Phone", "gl": {"renderer": "GPU"}}
    assert (device.host, device.address, device.health) == ("here", None, GOOD)


def test_nothing_runs_on_it_before_it_was_checked(farm: Farm) -> None:
    farm.examiner.may_check.clear()
    with farm.tracked():
        attach(farm.adb, PHONE)
        device = farm.wait(lambda d: d.facts)
        assert device.presence == "online"
        assert not registry.ready(device)
        farm.examiner.may_check.set()
        assert farm.ready.get(timeout=10) == PHONE


def test_unplugged_it_says_so_and_plugged_in_again_it_is_ready_again(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.ready.get(timeout=10)
        detach(farm.adb, PHONE)
        assert "plug it in" in str(farm.wait(lambda d: d.presence == "offline").advice)
        attach(farm.adb, PHONE)
        assert farm.ready.get(timeout=10) == PHONE
    assert farm.examiner.checks == 1, "the last check is not a day old"


def test_an_absence_too_short_to_be_shown_is_one(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.ready.get(timeout=10)
        farm.adb.set({PHONE: "device"}, DeviceEvent(False, PHONE, "absent"), DeviceEvent(True, PHONE, "device"))
        assert farm.ready.get(timeout=10) == PHONE


def test_an_unauthorized_phone_says_what_to_tap(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, PHONE, "unauthorized")
        assert "tap Allow" in str(farm.wait(lambda d: d.presence == "unauthorized").advice)
        attach(farm.adb, PHONE)
        assert farm.ready.get(timeout=10) == PHONE
        assert farm.wait(registry.ready).advice is None


def test_a_phone_that_fails_is_set_aside_until_cleared(farm: Farm) -> None:
    farm.examiner.health = BAD
    with farm.tracked():
        attach(farm.adb, PHONE)
        assert farm.wait(lambda d: d.set_aside).set_aside == BAD["reason"]
        assert farm.ready.empty()
        with farm.database.writing() as session:
            registry.clear(session.get_one(Device, PHONE))
        assert farm.ready.get(timeout=10) == PHONE
    assert farm.examiner.checks == 1


def test_a_phone_that_goes_while_it_is_checked_has_failed_nothing(farm: Farm) -> None:
    farm.examiner.health = DeviceGoneError("gone")
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.wait(lambda _: farm.examiner.checks >= 2)
        device = farm.device()
        assert device is not None
        assert (device.set_aside, device.health) == (None, None)
        farm.examiner.health = GOOD
        assert farm.ready.get(timeout=10) == PHONE


@pytest.mark.parametrize(
    "trouble", [UnableError("The phone's agent is not built: run `make agent`."), PlanError("x y")]
)
def test_what_the_host_cannot_do_is_shown_and_tried_again(farm: Farm, trouble: Exception) -> None:
    farm.examiner.health = trouble
    with farm.tracked():
        attach(farm.adb, PHONE)
        device = farm.wait(lambda d: d.advice)
        assert (device.advice, device.set_aside) == (str(trouble), None)
        farm.examiner.health = GOOD
        assert farm.ready.get(timeout=10) == PHONE
        farm.wait(lambda d: d.advice is None)


def test_an_idle_phones_battery_is_looked_at_and_an_old_check_repeated(farm: Farm) -> None:
    farm.pace = Pace(condition_s=0.02, health_s=0.1, again_s=0.02)
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.wait(lambda d: d.facts.get("battery") and farm.examiner.checks >= 2)
    assert farm.ready.get() == PHONE
    assert farm.ready.empty(), "it was ready all the time"


def test_a_new_system_is_checked_anew(farm: Farm) -> None:
    farm.examiner.described = {"fingerprint": "1"}
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.ready.get(timeout=10)
        farm.examiner.described = {"fingerprint": "2"}
        detach(farm.adb, PHONE)
        farm.wait(lambda d: d.presence == "offline")
        attach(farm.adb, PHONE)
        farm.wait(lambda _: farm.examiner.checks == 2)


def test_a_wanted_phone_is_connected_to_and_again_when_lost(farm: Farm) -> None:
    farm.want()
    with farm.tracked():
        assert farm.ready.get(timeout=10) == PHONE
        farm.links.answers[PHONE] = AttachError("Nothing answers there.")
        detach(farm.adb, PHONE)
        farm.wait(lambda d: d.advice == "Nothing answers there.")
        del farm.links.answers[PHONE]
        assert farm.ready.get(timeout=10) == PHONE
    assert set(farm.links.asked) == {f"connect {PHONE}"}


def test_a_forgotten_phone_is_disconnected_and_stays_forgotten(farm: Farm) -> None:
    farm.want()
    with farm.tracked():
        farm.ready.get(timeout=10)
        with farm.database.writing() as session:
            session.delete(session.get_one(Device, PHONE))
        deadline = time.monotonic() + 10
        while PHONE in (farm.adb.now if isinstance(farm.adb.now, dict) else ()):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        attach(farm.adb, "usb")
        assert farm.ready.get(timeout=10) == "usb"
        assert farm.device() is None


def test_pairing_is_answered_and_the_code_is_gone(farm: Farm, caplog: pytest.LogCaptureFixture) -> None:
    farm.links.answers["h:2"] = AttachError("The phone did not pair.")
    with farm.database.writing() as session:
        wanted.want_pairing(session, "h:1", "123456", "here")
        wanted.want_pairing(session, "h:2", "654321", "here")
    with caplog.at_level("DEBUG"), farm.tracked():
        assert "now attach" in str(farm.wait(lambda d: d.presence == "online", "pair@h:1").advice)
        device = farm.wait(lambda d: d.presence == "offline", "pair@h:2")
    assert device.advice == "The phone did not pair."
    assert device.facts == {"address": "h:2"}
    assert sorted(farm.links.asked) == ["pair h:1 123456", "pair h:2 654321"]
    assert "123456" not in caplog.text


def test_without_an_adb_server_phones_are_offline_and_say_why(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, PHONE)
        farm.ready.get(timeout=10)
        farm.adb.now = OSError("refused")
        farm.adb.end()
        assert "No adb server can be had on here" in str(farm.wait(lambda d: d.presence == "offline").advice)
        farm.adb.now = {PHONE: "device"}
        assert farm.ready.get(timeout=20) == PHONE


def test_hostile_serials_are_not_seen(farm: Farm) -> None:
    with farm.tracked():
        attach(farm.adb, "p;reboot")
        attach(farm.adb, "<script>")
        attach(farm.adb, PHONE)
        farm.ready.get(timeout=10)
    assert farm.device("p;reboot") is None
    assert farm.device("<script>") is None


def test_one_worker_of_a_host_tracks_and_another_takes_over(farm: Farm) -> None:
    second = Farm(farm.database)
    with farm.tracked(twin=True) as first:
        assert farm.ready.get(timeout=10) == "llvmpipe@here"
        with second.tracked(twin=True):
            attach(second.adb, PHONE)
            time.sleep(0.2)
            assert second.ready.empty()
            first.stop()
            assert {second.ready.get(timeout=10) for _ in range(2)} == {"llvmpipe@here", PHONE}


def test_it_survives_a_database_that_does_not_answer(farm: Farm, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = [OperationalError("x", None, Exception("x"))] * 2

    def note(*arguments: Any) -> set[str]:
        if broken:
            raise broken.pop()
        return note_states(*arguments)

    monkeypatch.setattr("server.devices.tracker.note_states", note)
    with farm.tracked():
        attach(farm.adb, PHONE)
        assert farm.ready.get(timeout=10) == PHONE
    assert not broken
