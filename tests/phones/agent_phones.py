"""What the tests of the agent as a host share: a built agent, a host on a stand-in phone, small plans, marks of use."""

from __future__ import annotations

import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import attach, state, wait_until
from renderer.plan import Plan
from renderer.prepare import prepare
from renderer.request import Request
from renderer.variant import Variant
from server.devices.agent_package import BUILD, MAIN

SIZE = (48, 32)


@cache
def build_agent() -> None:
    """Build the agent and what runs it here, unless they are up to date."""
    missing = [program for program in ("javac", "mvn", "enjarify") if shutil.which(program) is None]
    if missing:
        pytest.skip(f"the agent cannot be built here without {', '.join(missing)}")
    command = [sys.executable, str(BUILD.parent / "build.py"), "desktop"]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr


def use(adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch) -> str:
    """Make this the adb server, with the phone attached; return the phone's serial."""
    build_agent()
    monkeypatch.setenv("ANDROID_ADB_SERVER_PORT", str(adb.port))
    attach(adb, phone)
    return phone.serial


def plan(method: str = "compute", *, instrument: bool = False, size: tuple[int, int] = SIZE) -> Plan:
    """A plan of a small scene."""
    return prepare(Request("cornell-box", Variant(method=method), size=size)).plan(instrument=instrument)


def agents(phone: StandInPhone) -> list[int]:
    """The ids of the agent's processes on the phone."""
    return [one.pid for one in phone.processes() if MAIN in one.command]


def assert_as_found(phone: StandInPhone) -> None:
    """No process and no file of a run is left on the phone."""
    wait_until(lambda: phone.processes() == [])
    assert sorted(phone.local_tmp.rglob("*")) == []


def plug_in(adb: AdbServer, phone: StandInPhone) -> None:
    """Plug the phone in again, and wait until adb has it."""
    phone.restart()
    wait_until(lambda: state(adb, phone) == "device")


def desktop_that(folder: Path, script: str) -> Path:
    """What `app_process` runs in place of the agent: a script that gets the jar, the class and the agent's words."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "run.sh"
    path.write_text(f"#!/bin/bash\n{script}\n")
    path.chmod(0o755)
    return path
