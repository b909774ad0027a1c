"""A phone that is unplugged, or hangs, in the middle of a run: one sentence, nothing runs on, the next run works."""

from __future__ import annotations

import io
import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.agent_phones import agents, assert_as_found, desktop_that, plan, plug_in, use
from phones.standin_helpers import wait_until
from renderer.host import DeviceGoneError
from renderer.plan import Buffer, PlanError
from server.devices.adb import Phone, PhoneError
from server.devices.agent_host import AgentHost
from server.devices.agent_package import find_agent
from server.devices.agent_words import AgentWords
from server.devices.shell_way import ShellWay
from server.devices.wire import Wire

LARGE = (384, 384)
"""Instrumented, its record is larger than what lies between two sockets."""
BALLAST = 4 << 20
"""Words that make a plan so, too."""


@pytest.fixture
def host(adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch) -> AgentHost:
    host = AgentHost(use(adb, phone, monkeypatch))
    host.probe()
    return host


def unplug_pushing(phone: StandInPhone, patch: pytest.MonkeyPatch) -> None:
    """Unplug in the middle of the plan."""
    write, pieces = Wire.write, itertools.count()

    def interrupted(wire: Wire, data: bytes) -> None:
        if data[:4] == b"DATA" and next(pieces) == 100:
            assert (phone.local_tmp / "rayfarm/plan").exists()
            phone.kill()
        write(wire, data)

    patch.setattr(Wire, "write", interrupted)


def unplug_running(phone: StandInPhone, patch: pytest.MonkeyPatch) -> None:
    """Unplug when the agent says that it compiled."""
    hear = AgentWords.hear

    def interrupted(words: AgentWords, kind: int, piece: bytes) -> None:
        hear(words, kind, piece)
        if words.phase == "compiled":
            assert agents(phone)
            phone.kill()

    patch.setattr(AgentWords, "hear", interrupted)


def unplug_pulling(phone: StandInPhone, patch: pytest.MonkeyPatch) -> None:
    """Unplug when the record's first piece comes in."""
    pieces, unplugged = Wire.pieces, iter([True])

    def interrupted(wire: Wire, count: int) -> Any:
        if (phone.local_tmp / "rayfarm/record").exists() and not agents(phone) and next(unplugged, False):
            phone.kill()
        return pieces(wire, count)

    patch.setattr(Wire, "pieces", interrupted)


@pytest.mark.parametrize(
    ("unplug", "sentence"),
    [
        (unplug_pushing, "went away while pushing the plan"),
        (unplug_running, r"went away while running the plan .* last word was: compiled\.$"),
        (unplug_pulling, "went away while pulling the record"),
    ],
    ids=["pushing", "running", "pulling"],
)
def test_unplugged_it_is_gone_and_plugged_in_it_runs_again(
    host: AgentHost, adb: AdbServer, phone: StandInPhone, unplug: Any, sentence: str
) -> None:
    small = plan(instrument=True, size=LARGE)
    ballast = Buffer("ballast", 4 * BALLAST, np.zeros(BALLAST, np.uint32))
    instrumented = replace(small, buffers=(*small.buffers, ballast))
    whole = host.collect(instrumented)
    with pytest.MonkeyPatch.context() as patch:
        unplug(phone, patch)
        with pytest.raises(DeviceGoneError, match=sentence):
            host.collect(instrumented)
    wait_until(lambda: phone.processes() == [])
    with pytest.raises(DeviceGoneError, match="went away while clearing what an earlier run left"):
        host.collect(instrumented)
    plug_in(adb, phone)
    again = host.collect(instrumented)
    assert [tile for tile, _ in again] == [tile for tile, _ in whole]
    assert all((ours == theirs).all() for (_, ours), (_, theirs) in zip(again, whole, strict=True))
    assert_as_found(phone)


def test_a_phone_that_was_never_there_is_gone(adb: AdbServer, phone: StandInPhone, monkeypatch: Any) -> None:
    use(adb, phone, monkeypatch)
    with pytest.raises(DeviceGoneError, match=r"^The phone nobody-here went away while .* not found"):
        AgentHost("nobody-here").probe()


def test_a_gpu_that_hangs_ends_at_the_agent_s_deadline(
    adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = AgentHost(use(adb, phone, monkeypatch), deadline_s=8.0)
    host.probe()
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:3")
    with pytest.raises(PlanError, match=r"did not end within its deadline of 8(\.0)? s"):
        host.measure(plan(), 2, lambda: None)
    assert_as_found(phone)
    phone.persona.set_environment()
    assert host.measure(plan(), 1, lambda: None).image.any()


def test_a_caller_that_is_killed_leaves_nothing_running(host: AgentHost, phone: StandInPhone) -> None:
    phone.persona.set_environment(RAYFARM_SHIM_HANG="finish:1")
    words = f"from server.devices.agent_host import AgentHost; AgentHost('{phone.serial}').probe()"
    with subprocess.Popen([sys.executable, "-c", words]) as caller:
        wait_until(lambda: agents(phone), 60.0)
        caller.kill()
    wait_until(lambda: phone.processes() == [])
    phone.persona.set_environment()
    assert host.measure(plan(), 1, lambda: None).image.any()
    assert_as_found(phone)


class TestWithAnotherAgent:
    """What runs in place of the agent is a script, so that it can do what the agent never would."""

    @pytest.fixture
    def script(self) -> str:
        return "exit 1"

    @pytest.fixture
    def desktop(self, tmp_path: Path, script: str) -> Path:
        return desktop_that(tmp_path / "another", script)

    @pytest.fixture
    def host(self, adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch) -> AgentHost:
        return AgentHost(use(adb, phone, monkeypatch), deadline_s=0.5, grace_s=0.5)

    @pytest.mark.parametrize("script", ["echo rayfarm compiled; trap '' HUP TERM INT; exec -a \"$2\" sleep 600"])
    def test_one_that_knows_no_deadline_is_ended(self, host: AgentHost, phone: StandInPhone) -> None:
        with pytest.raises(PhoneError, match=r"deadline of 0\.5 s and was ended: .* last word was: compiled\.$"):
            host.probe()
        assert_as_found(phone)

    @pytest.mark.parametrize("script", ["echo rayfarm done; echo a >&2; printf 'driver\\033 fell\\n' >&2; exit 0"])
    def test_one_that_leaves_no_record_did_not_run(self, host: AgentHost, phone: StandInPhone) -> None:
        with pytest.raises(PhoneError, match=r"left no record .* was: done; its last error: driver fell\."):
            host.probe()
        assert_as_found(phone)

    @pytest.mark.parametrize("script", ["yes 'rayfarm frame 1' & yes $'\\033[2J' >&2"])
    def test_one_that_never_stops_talking_is_ended(self, host: AgentHost, phone: StandInPhone) -> None:
        with pytest.raises(PhoneError, match="and was ended"):
            host.probe()
        wait_until(lambda: agents(phone) == [])

    @pytest.mark.parametrize("script", ["sleep 1"])
    def test_one_that_is_silent_is_not_gone(self, adb: AdbServer, phone: StandInPhone, monkeypatch: Any) -> None:
        way = ShellWay(Phone(use(adb, phone, monkeypatch), patience_s=0.5), find_agent(), grace_s=5.0)
        way.clear(fresh=True)
        way.send(None)
        way.run("probe", [], 5.0)
        with pytest.raises(PhoneError, match="left no record"):
            way.fetch(io.BytesIO(), 100)

    @pytest.mark.parametrize(
        ("script", "sentence"),
        [
            ("echo RAYRSLT >record", "torn"),
            ("head -c 100 /dev/urandom >record", "no record"),
            ("head -c 30000000 /dev/zero >record", "larger than"),
            ("mkdir record", "left no record"),
            ("ln -s /etc/passwd record", "no record"),
        ],
    )
    def test_one_that_leaves_something_else_is_refused(
        self, host: AgentHost, phone: StandInPhone, sentence: str
    ) -> None:
        with pytest.raises(PlanError, match=sentence):
            host.probe()
        assert_as_found(phone)
