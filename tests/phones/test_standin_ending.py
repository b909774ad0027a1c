"""No phone outlives who started it, however that ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from agent_android.standin import loopback
from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import attach, run, wait_until

ROOT = Path(__file__).parent.parent.parent


@pytest.fixture
def port(phone: StandInPhone) -> int:
    """A free one (the phone itself shows that this machine can have phones)."""
    phone.stop()
    return phone.port


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL], ids=lambda one: one.name)
def test_the_command_ends_its_phones(adb: AdbServer, port: int, ending: signal.Signals, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "agent_android.standin", "--port", str(port), "--model", "a <b>"]
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True) as owner:
        assert owner.stdout is not None
        said = [owner.stdout.readline() for _ in range(3)]
        assert said[1:] == [f"  adb connect 127.0.0.1:{port}\n", f"  rayfarm devices attach 127.0.0.1:{port}\n"]
        assert adb.client().connect(f"127.0.0.1:{port}") == f"connected to 127.0.0.1:{port}"
        assert run(adb.client().device(f"127.0.0.1:{port}"), "getprop ro.product.model") == b"a <b>\n"
        owner.send_signal(ending)
        assert owner.wait(10) == (-ending if ending == signal.SIGKILL else 0)
        wait_until(lambda: not loopback.listeners(port))
    adb.client().disconnect(f"127.0.0.1:{port}")


def test_the_command_ends_with_its_parent(port: int) -> None:
    script = f"{sys.executable} -m agent_android.standin --port {port} & read -r line"
    with subprocess.Popen(["/bin/sh", "-c", script], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        assert parent.stdout.readline().startswith(b"A phone is at")
        parent.kill()
        wait_until(lambda: not loopback.listeners(port))


def test_a_phone_that_was_off_starts_again_over_its_files(adb: AdbServer, phone: StandInPhone) -> None:
    (phone.local_tmp / "kept").write_text("kept")
    phone.stop()
    phone.stop()
    phone.start()
    assert run(attach(adb, phone), "cat /data/local/tmp/kept") == b"kept"


def test_a_private_adb_server_leaves_the_users_alone(adb: AdbServer) -> None:
    folder = Path(adb.environment["HOME"])
    assert (folder / ".android" / "adbkey").exists()
    assert adb.port != 5037
    assert [str(one) for one in loopback.listeners(adb.port)] == ["127.0.0.1"]
