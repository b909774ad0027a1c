"""The agent as an app, over a stand-in's package and activity managers: what a real phone's do is unproven."""

from __future__ import annotations

import io
from typing import IO

import numpy as np
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.agent_phones import assert_as_found, plan, use
from phones.standin_helpers import run, wait_until
from renderer.plan import PlanError
from renderer.twin_host import TwinHost
from server.devices.adb import Phone, PhoneError
from server.devices.agent_host import AgentHost
from server.devices.agent_package import BUILD, PACKAGE


@pytest.fixture
def host(adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch) -> AgentHost:
    serial = use(adb, phone, monkeypatch)
    if not (BUILD / "agent.apk").exists():
        pytest.skip("agent.apk is not built: apt install aapt zipalign apksigner")
    return AgentHost(serial, via="apk", deadline_s=60.0)


def screen(phone: StandInPhone) -> str:
    return (phone.root / "state/wakefulness").read_text().strip()


def installed(adb: AdbServer, phone: StandInPhone) -> bytes:
    return run(adb.client().device(phone.serial), "pm list packages")


def test_it_gives_the_twin_s_records_and_image(host: AgentHost, adb: AdbServer, phone: StandInPhone) -> None:
    assert host.device()["via"] == "apk"
    instrumented, timed = plan(instrument=True), plan()
    for (tile, words), (place, expected) in zip(
        host.collect(instrumented), TwinHost(1).collect(instrumented), strict=True
    ):
        assert tile == place
        np.testing.assert_array_equal(words, expected)
    image = TwinHost(1).measure(timed, 1, lambda: None).image
    np.testing.assert_array_equal(host.measure(timed, 2, lambda: None).image, image)
    assert_as_found(phone)
    assert (installed(adb, phone), screen(phone)) == (b"", "Asleep")


def test_an_app_and_a_lit_screen_that_were_there_stay(host: AgentHost, adb: AdbServer, phone: StandInPhone) -> None:
    with (BUILD / "agent.apk").open("rb") as apk:
        Phone(phone.serial).push(apk, "/data/local/tmp/own.apk", "pushing")
    run(
        adb.client().device(phone.serial),
        "pm install /data/local/tmp/own.apk >/dev/null; input keyevent KEYCODE_WAKEUP",
    )
    assert host.measure(plan(), 1, lambda: None).image.any()
    assert (installed(adb, phone), screen(phone)) == (f"package:{PACKAGE}\n".encode(), "Awake")
    assert [path.name for path in phone.local_tmp.iterdir()] == ["own.apk"]
    assert run(adb.client().device(phone.serial), f"run-as {PACKAGE} ls files") == b""


def test_a_gpu_that_hangs_ends(host: AgentHost, adb: AdbServer, phone: StandInPhone) -> None:
    host.probe()
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:1")
    hung = AgentHost(phone.serial, via="apk", deadline_s=3.0)
    with pytest.raises(PlanError, match=r"did not end within its deadline of 3(\.0)? s"):
        hung.measure(plan(), 1, lambda: None)
    assert_as_found(phone)
    assert (installed(adb, phone), screen(phone)) == (b"", "Asleep")


def test_what_a_killed_run_left_is_removed_by_the_next(
    host: AgentHost, adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch
) -> None:
    fetch = host._way.fetch

    def unplugged(record: IO[bytes], most: int) -> None:
        phone.kill()
        fetch(record, most)

    with monkeypatch.context() as patch:
        patch.setattr(host._way, "fetch", unplugged)
        with pytest.raises(RuntimeError, match="went away while taking the record"):
            host.probe()
    phone.restart()
    adb.client().disconnect(phone.serial)
    adb.client().connect(phone.serial)
    assert (installed(adb, phone), screen(phone)) == (f"package:{PACKAGE}\n".encode(), "Awake")
    again = AgentHost(phone.serial, via="apk")
    assert again.device()["agent"]
    wait_until(lambda: phone.processes() == [])
    assert_as_found(phone)
    assert (installed(adb, phone), screen(phone)) == (b"", "Asleep")


def test_an_apk_that_is_no_apk_is_refused(
    host: AgentHost, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken, push = io.BytesIO(b"PK"), Phone.push
    monkeypatch.setattr(Phone, "push", lambda phone, _, remote, doing: push(phone, broken, remote, doing))
    with pytest.raises(PhoneError, match="APK cannot be installed: Failure"):
        host.probe()
    assert_as_found(phone)
    assert screen(phone) == "Asleep"
