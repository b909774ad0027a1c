"""`app_process` on the stand-in phone: a real DEX runs, is found by name, and ends with its caller."""

from __future__ import annotations

import hashlib
from pathlib import Path

import adbutils
import pytest

from agent_android.standin import sandbox
from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.standin_helpers import HERE, open_shell, run, state, wait_until

MAIN = "CLASSPATH=/data/local/tmp/hello.jar app_process"


@pytest.fixture
def desktop(tmp_path: Path) -> Path:
    """The bare JVM: hello.jar needs no GL."""
    script = tmp_path / "desktop" / "run.sh"
    script.parent.mkdir()
    script.write_text('#!/bin/sh\njar=$1\nshift\nexec java -XX:TieredStopAtLevel=1 -cp "$jar" "$@"\n')
    script.chmod(0o755)
    return script


@pytest.fixture
def device(device: adbutils.AdbDevice) -> adbutils.AdbDevice:
    device.sync.push(HERE / "hello.jar", "/data/local/tmp/hello.jar")
    return device


def test_the_dex_runs_with_its_arguments_and_environment(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    phone.persona.set_environment(HELLO="x = $(y) 'z'")
    said = run(device, f"{MAIN} / Hello 'a b' '' '$c' </dev/null")
    assert said.decode().splitlines() == [
        "argument a b",
        "argument ",
        "argument $c",
        "ready x = $(y) 'z'",
        "end of input",
    ]


def test_a_dex_is_converted_once(device: adbutils.AdbDevice) -> None:
    digest = hashlib.sha256((HERE / "hello.jar").read_bytes()).hexdigest()
    run(device, f"{MAIN} / Hello </dev/null")
    kept = (sandbox.dex_cache() / f"{digest}.jar").stat()
    run(device, f"{MAIN} / Hello </dev/null")
    assert (sandbox.dex_cache() / f"{digest}.jar").stat().st_mtime_ns == kept.st_mtime_ns


@pytest.mark.parametrize(
    ("options", "name"), [("/", "app_process"), ("-Xint / --nice-name=rayfarm.agent", "rayfarm.agent")]
)
def test_it_is_found_by_name(device: adbutils.AdbDevice, phone: StandInPhone, options: str, name: str) -> None:
    with open_shell(device, f"{MAIN} {options} Hello here"):
        wait_until(lambda: any(one.command[0] == name for one in phone.processes()))
        found = next(one for one in phone.processes() if one.command[0] == name)
        assert found.command[-2:] == ("Hello", "here")
        assert int(run(device, f"pidof {name}")) == found.pid
        assert str(found.pid) in run(device, "pgrep -f 'Hello [h]ere'").decode().split()
    wait_until(lambda: phone.processes() == [])


def test_it_ends_when_unplugged(adb: AdbServer, phone: StandInPhone, device: adbutils.AdbDevice) -> None:
    with open_shell(device, f"{MAIN} / Hello") as shell:
        assert b"ready" in shell.conn.recv(100)
        phone.kill()
        wait_until(lambda: phone.processes() == [])
    phone.restart()
    wait_until(lambda: state(adb, phone) == "device")
    assert b"end of input" in run(device, f"{MAIN} / Hello </dev/null")


def test_megabytes_of_noise_come_first(device: adbutils.AdbDevice, phone: StandInPhone) -> None:
    phone.persona.set_flood(stdout=3_000_000)
    said = run(device, f"{MAIN} / Hello </dev/null")
    assert len(said) > 3_000_000
    assert said.endswith(b"end of input\n")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("CLASSPATH=/data/local/tmp/none.jar app_process / Hello", "'/data/local/tmp/none.jar' cannot be read"),
        ("app_process / Hello", "class path '' cannot be read"),
        ("CLASSPATH=/data/local/tmp/hello.jar app_process /", "no class name given"),
        ("echo x >/data/local/tmp/x.jar; CLASSPATH=/data/local/tmp/x.jar app_process / X", "holds no DEX"),
    ],
    ids=["missing", "none", "no-class", "not-dex"],
)
def test_what_cannot_run_says_why(device: adbutils.AdbDevice, command: str, said: str) -> None:
    done = device.shell2(command, v2=True)
    assert done.returncode == 1
    assert said in done.stderr
