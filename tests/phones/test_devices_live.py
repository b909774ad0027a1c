"""The tracker with real phones: attached through the API, described, checked, shown; unplugged and plugged in again."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import wait_until
from server.cli import devices as cli_devices
from server.devices.adb import PhoneError
from server.devices.agent_package import find_agent
from server.devices.tracker import Tracker
from server.queue.lives import worker_id
from server.service import address, listen, running
from server.settings import Settings
from server.store.database import Database
from server.store.models import Worker

HOST = "here"
SOON_S = 60.0
HOSTILE = '<script>alert(1)</script>\x1b[2J;$(reboot)`id`,=HYPERLINK("http://x")|\u202e'

Json = dict[str, Any]


class Farm:
    """A service, and a tracker as a worker of this host has one."""

    def __init__(self, client: httpx.Client, ready: queue.Queue[str], tracker: Tracker) -> None:
        self.client, self.ready, self.tracker = client, ready, tracker

    def get(self, device_id: str) -> Json:
        answer = self.client.get(f"/api/v1/devices/{device_id}")
        assert answer.status_code == 200, answer.text
        found: Json = answer.json()
        return found

    def attach(self, *phones: StandInPhone) -> None:
        for phone in phones:
            answer = self.client.post("/api/v1/devices", json={"address": phone.serial})
            assert answer.status_code == 202, answer.text

    def wait(self, device_id: str, holds: Callable[[Json], object]) -> Json:
        wait_until(lambda: holds(self.get(device_id)), SOON_S)
        return self.get(device_id)


@pytest.fixture
def farm(tmp_path: Path, adb: AdbServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[Farm]:
    try:
        find_agent()
    except PhoneError as error:
        pytest.skip(str(error))
    for name, value in adb.environment.items():
        monkeypatch.setenv(name, value)
    with farming(f"sqlite:///{tmp_path / 'farm.sqlite'}") as one:
        yield one


@contextmanager
def farming(url: str) -> Iterator[Farm]:
    with ExitStack() as stack:
        sock = listen("127.0.0.1", 0)
        stack.enter_context(running(Settings(database_url=url), sock, with_worker=False))
        client = stack.enter_context(httpx.Client(base_url=address(sock), timeout=30, trust_env=False))
        database = Database(url)
        stack.callback(database.close)
        with database.writing() as session:
            session.add(Worker(id=worker_id("test"), host=HOST))
        ready: queue.Queue[str] = queue.Queue()
        tracker = Tracker(database, HOST, ready.put, twin=False)
        tracker.start()
        stack.callback(tracker.stop)
        yield Farm(client, ready, tracker)


def test_a_phone_is_attached_described_checked_and_shown(farm: Farm, phone: StandInPhone) -> None:
    farm.attach(phone)
    assert farm.ready.get(timeout=SOON_S) == phone.serial
    device = farm.wait(phone.serial, lambda d: d["ready"])
    facts = device["facts"]
    assert (facts["name"], facts["soc"], facts["android"]) == ("RayFarm Stand-in", "llvmpipe", "14")
    assert "llvmpipe" in facts["gl"]["renderer"]
    assert facts["gl"]["version"].startswith("OpenGL ES 3.1")
    assert facts["limits"]["COMPUTE_SHADER_STORAGE_BLOCKS"] >= 4
    assert (facts["battery"]["level"], facts["thermal"]["name"]) == (87, "none")
    assert facts["precision"]["compute"]["add"]["wrong"] == 0
    assert device["health"]["passed"]
    assert device["health"]["identical"] == {"hits": True, "t": True}
    page = farm.client.get("/devices").text
    assert phone.serial in page
    assert "RayFarm Stand-in" in page
    assert phone.processes() == []


def test_unplugged_and_plugged_in_again(farm: Farm, phone: StandInPhone, other_phone: StandInPhone) -> None:
    farm.attach(phone, other_phone)
    assert {farm.ready.get(timeout=SOON_S) for _ in range(2)} == {phone.serial, other_phone.serial}
    phone.kill()
    gone = farm.wait(phone.serial, lambda d: d["presence"] == "offline")
    assert not gone["ready"]
    assert gone["advice"]
    assert farm.get(other_phone.serial)["ready"]
    phone.restart()
    assert farm.ready.get(timeout=SOON_S) == phone.serial
    assert farm.wait(phone.serial, lambda d: d["ready"])["advice"] is None


def test_a_phone_that_computes_nothing_is_set_aside_until_cleared(farm: Farm, phone: StandInPhone) -> None:
    phone.persona.set_environment(RAYFARM_SHIM_LIMITS="MAX_COMPUTE_SHADER_STORAGE_BLOCKS=0")
    farm.attach(phone)
    device = farm.wait(phone.serial, lambda d: d["set_aside"])
    assert "COMPUTE_SHADER_STORAGE_BLOCKS = 0" in device["set_aside"]
    assert farm.ready.empty()
    assert farm.client.post(f"/api/v1/devices/{phone.serial}/clear").json()["ready"]
    assert farm.ready.get(timeout=SOON_S) == phone.serial


def test_a_hostile_phone_is_inert(farm: Farm, phone: StandInPhone, capsys: pytest.CaptureFixture[str]) -> None:
    phone.persona.set_model(HOSTILE)
    phone.persona.set_dumpsys("battery", "level: 99999999999999999999\n" + "x" * 1_000_000)
    farm.attach(phone)
    device = farm.wait(phone.serial, lambda d: d["facts"].get("name"))
    assert "\x1b" not in device["name"]
    assert "\u202e" not in device["name"]
    assert device["facts"]["battery"]["level"] is None
    page = farm.client.get("/devices").text
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)" in page
    cli_devices._print_table(farm.client.get("/api/v1/devices").json()["devices"])
    printed = capsys.readouterr().out
    assert "<script>alert(1)" in printed
    assert "\x1b" not in printed


@pytest.mark.filterwarnings("ignore:Exception ignored in. <socket:pytest.PytestUnraisableExceptionWarning")
def test_an_adb_server_that_dies_is_outlived(farm: Farm, adb: AdbServer, phone: StandInPhone) -> None:
    farm.attach(phone)
    assert farm.ready.get(timeout=SOON_S) == phone.serial
    adb.kill()
    try:
        assert farm.ready.get(timeout=SOON_S) == phone.serial
    finally:
        # adbutils started another server for the tracker, which is no child of ours.
        farm.tracker.stop()
        adb.client().server_kill()
        wait_until(lambda: not adb._answers())
        adb.start()


def test_a_forgotten_phone_is_disconnected(farm: Farm, adb: AdbServer, phone: StandInPhone) -> None:
    farm.attach(phone)
    farm.ready.get(timeout=SOON_S)
    assert farm.client.delete(f"/api/v1/devices/{phone.serial}").status_code == 204
    wait_until(lambda: phone.serial not in {info.serial for info in adb.client().list()}, SOON_S)
    assert farm.client.get(f"/api/v1/devices/{phone.serial}").status_code == 404


def test_nothing_at_an_address_says_so(farm: Farm) -> None:
    assert farm.client.post("/api/v1/devices", json={"address": "127.0.0.1:1"}).status_code == 202
    device = farm.wait("127.0.0.1:1", lambda d: d["presence"] == "offline")
    assert "Nothing answers there" in device["advice"]


def test_pairing_with_nothing_fails_without_the_code(farm: Farm) -> None:
    asked = farm.client.post("/api/v1/devices/pair", json={"address": "127.0.0.1:1", "code": "918273"})
    assert asked.status_code == 202, asked.text
    pairing = farm.wait("pair@127.0.0.1:1", lambda d: d["presence"] == "offline")
    assert "did not pair" in pairing["advice"]
    assert "918273" not in str(farm.client.get("/api/v1/devices").json())
