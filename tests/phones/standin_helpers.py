"""What the tests of the stand-in phone share."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import adbutils

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone

HERE = Path(__file__).parent


def attach(adb: AdbServer, phone: StandInPhone) -> adbutils.AdbDevice:
    assert adb.client().connect(phone.serial) == f"connected to {phone.serial}"
    return adb.client().device(phone.serial)


def state(adb: AdbServer, phone: StandInPhone) -> str:
    states: dict[str, str] = {one.serial: one.state for one in adb.client().list()}
    return states.get(phone.serial, "absent")


def run(device: adbutils.AdbDevice, command: str) -> bytes:
    """Standard output, byte for byte; the command must succeed and say nothing else."""
    with device.open_transport() as connection:
        connection.send_command(f"shell,v2,raw:{command}")
        connection.check_okay()
        streams = _packets(connection)
    assert streams[2] == b""
    assert streams[3] == b"\0"
    return streams[1]


def open_shell(device: adbutils.AdbDevice, command: str) -> adbutils.AdbConnection:
    """A shell whose standard input stays open until the connection is closed."""
    connection = device.open_transport()
    connection.send_command(f"shell,v2,raw:{command}")
    connection.check_okay()
    return connection


def wait_until(holds: Callable[[], object], patience_s: float = 10.0) -> None:
    """Waits for what comes soon; the patience is no measure of how soon."""
    deadline = time.monotonic() + patience_s
    while not holds():
        assert time.monotonic() < deadline, "it did not come about"
        time.sleep(0.005)


def _packets(connection: adbutils.AdbConnection) -> dict[int, bytes]:
    """What came on each stream (1 out, 2 err, 3 exit status) until the end."""
    streams = {1: b"", 2: b"", 3: b""}
    stream = connection.conn.makefile("rb")
    with stream:
        while header := stream.read(5):
            streams[header[0]] += stream.read(int.from_bytes(header[1:], "little"))
    return streams
