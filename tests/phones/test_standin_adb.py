"""A stand-in phone over a real adb server: shell, push, pull, two at once, unplugged and plugged in again."""

from __future__ import annotations

import os
from pathlib import Path

import adbutils
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import attach, open_shell, run, state, wait_until


def test_the_shell_is_the_phones(device: adbutils.AdbDevice) -> None:
    assert run(device, "id -u; pwd; echo $TMPDIR").split() == [b"2000", b"/", b"/data/local/tmp"]


@pytest.mark.parametrize("size", [0, 1, 65_537, 5_000_000])
def test_files_come_back_as_they_went(
    device: adbutils.AdbDevice, phone: StandInPhone, tmp_path: Path, size: int
) -> None:
    sent, returned = tmp_path / "sent", tmp_path / "returned"
    sent.write_bytes(os.urandom(size))
    device.sync.push(sent, "/data/local/tmp/file")
    device.sync.pull("/data/local/tmp/file", returned)
    assert returned.read_bytes() == sent.read_bytes() == (phone.local_tmp / "file").read_bytes()


def test_the_owners_files_are_not_on_the_phone(device: adbutils.AdbDevice, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    found = device.shell2(f"cat {tmp_path}/secret /etc/shadow {Path.home()}/.ssh/*", v2=True)
    assert found.returncode != 0
    assert found.stdout == ""


def test_two_phones_share_nothing(
    device: adbutils.AdbDevice, other_device: adbutils.AdbDevice, phone: StandInPhone, other_phone: StandInPhone
) -> None:
    run(device, "echo mine >/data/local/tmp/mine; settings put system screen_brightness 7")
    assert run(other_device, "ls /data/local/tmp; settings get system screen_brightness") == b"null\n"
    with open_shell(device, "exec sleep 600"):
        wait_until(lambda: [one.command for one in phone.processes()] == [("sleep", "600")])
        assert b"sleep" not in run(other_device, "ps -A")
        assert other_phone.processes() == []


def test_unplugged_is_offline_and_plugged_in_is_back(adb: AdbServer, phone: StandInPhone) -> None:
    device = attach(adb, phone)
    run(device, "echo kept >/data/local/tmp/kept")
    phone.kill()
    wait_until(lambda: state(adb, phone) == "offline")
    phone.restart()
    wait_until(lambda: state(adb, phone) == "device")
    assert run(device, "cat /data/local/tmp/kept") == b"kept\n"


def test_what_runs_survives_the_cable_and_not_the_switch(adb: AdbServer, phone: StandInPhone) -> None:
    with open_shell(attach(adb, phone), "trap '' HUP; sleep 600 & sleep 600"):
        # A forked shell has the shell's own command until it is the sleep.
        wait_until(lambda: [one.command for one in phone.processes()].count(("sleep", "600")) == 2)
    phone.kill()
    assert ("sleep", "600") in [one.command for one in phone.processes()]
    phone.stop()
    assert phone.processes() == []
