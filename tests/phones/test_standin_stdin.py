"""A process on the phone learns from its standard input that its caller is gone, however the caller went."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import adbutils
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import attach, open_shell, wait_until

# HUP is ignored, so that only the end of its standard input can end `cat`.
WAITING = "trap '' HUP; touch /data/local/tmp/up; cat >/data/local/tmp/said; echo $? >/data/local/tmp/ended"


@pytest.fixture
def own_adb() -> AdbServer:
    return AdbServer()


def adbd_killed(adb: AdbServer, phone: StandInPhone, shell: adbutils.AdbConnection) -> None:
    phone.kill()


def client_closed(adb: AdbServer, phone: StandInPhone, shell: adbutils.AdbConnection) -> None:
    shell.close()


def disconnected(adb: AdbServer, phone: StandInPhone, shell: adbutils.AdbConnection) -> None:
    adb.client().disconnect(phone.serial)


def server_killed(adb: AdbServer, phone: StandInPhone, shell: adbutils.AdbConnection) -> None:
    adb.kill()


@pytest.mark.parametrize("end", [adbd_killed, client_closed, disconnected, server_killed])
def test_standard_input_ends(
    own_adb: AdbServer,
    phone: StandInPhone,
    end: Callable[[AdbServer, StandInPhone, adbutils.AdbConnection], None],
) -> None:
    with own_adb as adb, open_shell(attach(adb, phone), WAITING) as shell:
        wait_until((phone.local_tmp / "up").exists)
        assert not (phone.local_tmp / "ended").exists()
        end(adb, phone, shell)
        wait_until(lambda: _read(phone.local_tmp / "ended") == "0\n")
        wait_until(lambda: phone.processes() == [])


@pytest.mark.parametrize("flags", [[], ["-T"]], ids=["plain", "no-tty"])
def test_standard_input_ends_with_the_adb_program(
    adb: AdbServer, device: adbutils.AdbDevice, phone: StandInPhone, flags: list[str]
) -> None:
    command = [adbutils.adb_path(), "-s", phone.serial, "shell", *flags, WAITING]
    with subprocess.Popen(command, env={**os.environ, **adb.environment}, stdin=subprocess.PIPE) as client:
        wait_until((phone.local_tmp / "up").exists)
        assert not (phone.local_tmp / "ended").exists()
        client.kill()
        wait_until(lambda: _read(phone.local_tmp / "ended") == "0\n")


def _read(path: Path) -> str:
    return path.read_text() if path.exists() else ""
