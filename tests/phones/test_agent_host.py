"""The agent as a host, on a stand-in phone: it gives what the twin gives, and leaves the phone as found."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.agent_phones import agents, assert_as_found, build_agent, plan, use
from phones.standin_helpers import open_shell, run, wait_until
from renderer.bench import combine
from renderer.child import ChildError, run_child
from renderer.plan import PlanError
from renderer.request import Request
from renderer.twin_host import TwinHost
from renderer.variant import Variant
from server.devices.adb import Phone, PhoneError
from server.devices.agent_host import AgentHost
from server.devices.agent_package import BUILD, MAIN
from server.devices.shell_way import FOLDER


@pytest.fixture
def host(adb: AdbServer, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch) -> AgentHost:
    return AgentHost(use(adb, phone, monkeypatch))


def nothing() -> None:
    pass


@pytest.mark.parametrize("method", ["compute", "fragment", "hybrid"])
def test_records_and_image_are_the_twin_s_bit_for_bit(host: AgentHost, phone: StandInPhone, method: str) -> None:
    twin = TwinHost(1)
    instrumented, timed = plan(method, instrument=True), plan(method)
    ours, theirs = host.collect(instrumented), twin.collect(instrumented)
    assert [tile for tile, _ in ours] == [tile for tile, _ in theirs]
    for (_, words), (_, expected) in zip(ours, theirs, strict=True):
        assert words.dtype == np.uint32
        np.testing.assert_array_equal(words, expected)
    measured = host.measure(timed, 3, nothing)
    np.testing.assert_array_equal(measured.image, twin.measure(timed, 1, nothing).image)
    assert len(measured.frames.wall) == 3
    assert min(measured.frames.wall) > 0
    assert measured.frames.gpu == []
    assert measured.compile_s > 0
    assert_as_found(phone)


def test_a_plan_of_several_tiles_is_collected_tile_by_tile(host: AgentHost) -> None:
    tiled = plan(instrument=True, size=(520, 8))
    ours, theirs = host.collect(tiled), TwinHost(1).collect(tiled)
    assert [tile for tile, _ in ours] == [(0, 0, 512, 8), (512, 0, 8, 8)]
    # The second tile covers only a part of its buffer; the rest is what the first left there.
    for (_, words), (_, expected) in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(words, expected)


def test_the_device_says_what_it_is(host: AgentHost, phone: StandInPhone) -> None:
    device = host.device()
    assert (device["id"], device["kind"], device["name"]) == (phone.serial, "agent", "Stand-in")
    assert device["driver"].startswith("OpenGL ES 3.1")
    assert "llvmpipe" in device["renderer"]
    assert (device["android"], device["soc"], device["via"]) == ("14", "llvmpipe", "shell")
    assert host.limits()["COMPUTE_SHADER_STORAGE_BLOCKS"] >= 4
    assert json.loads(json.dumps(device)) == device
    assert_as_found(phone)


def test_counters_and_condition_stand_beside_the_frames(host: AgentHost, phone: StandInPhone) -> None:
    phone.persona.set_counter("kgsl/kgsl-3d0/temp", None)
    phone.persona.set_counter("thermal/thermal_zone7/type", "gpuss-0-usr")
    phone.persona.set_counter("thermal/thermal_zone7/temp", "44100")
    phone.persona.set_counter("devfreq/13000000.mali/cur_freq", "848000000")
    phone.persona.set_counter("kgsl/kgsl-3d0/gpuclk", None)
    phone.persona.set_counter("power_supply/battery/current_now", None)
    phone.persona.set_battery(level=41, celsius=33.5, plugged=False)
    phone.persona.set_thermal(3)
    samples = host.measure(plan(), 2, nothing).samples
    assert samples is not None
    zone = "/sys/class/thermal/thermal_zone7/temp"
    assert samples["counters"]["gpu_temp"] == {"file": zone, "values": [44100, 44100]}
    assert samples["counters"]["gpu_clock"]["values"] == [848000000, 848000000]
    assert samples["counters"]["gpu_busy"]["values"] == ["12 %", "12 %"]
    assert set(samples["unavailable"]) == {"battery_current", "skin_temp"}
    battery = {"level": 41, "temperature": 335, "voltage": 4123, "status": 3, "plugged": False}
    assert samples["before"] == samples["after"] == {"battery": battery, "thermal_status": 3}
    assert samples["throttled"] is True


def test_a_phone_that_says_nothing_of_its_state_is_not_said_to_be_cool(host: AgentHost, phone: StandInPhone) -> None:
    phone.persona.set_dumpsys("battery", "")
    phone.persona.set_dumpsys("thermalservice", "Can't find service: thermalservice\n")
    samples = host.measure(plan(), 1, nothing).samples
    assert samples is not None
    assert samples["throttled"] is None
    assert set(samples["before"]["battery"].values()) == {None}


def test_beyond_its_limits_nothing_is_pushed(
    host: AgentHost, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch
) -> None:
    phone.persona.set_environment(RAYFARM_SHIM_LIMITS="MAX_FRAGMENT_SHADER_STORAGE_BLOCKS=0")
    host.probe()
    with monkeypatch.context() as patch:
        patch.setattr(Phone, "push", lambda *_: pytest.fail("it was pushed"))
        for method in ("fragment", "hybrid"):
            with pytest.raises(PlanError, match=r"offers GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS = 0; the plan needs \d"):
                host.collect(plan(method, instrument=True))
    assert host.measure(plan("compute"), 1, nothing).image.any()


def test_a_plan_that_does_not_compile_says_so(host: AgentHost, phone: StandInPhone) -> None:
    made = plan()
    made.programs[0].stages["compute"] += "\nint broken = ;\n"
    with pytest.raises(PlanError, match=f"program {made.programs[0].name}"):
        host.measure(made, 1, nothing)
    assert_as_found(phone)


HOSTILE = (
    "$(touch /data/local/tmp/owned)`id`';\"<script>alert(1)</script>\x1b[31m{}\n\n\u202erm -rf /\udcff" + "A" * 100_000
)


def test_hostile_words_and_floods_are_inert(host: AgentHost, phone: StandInPhone) -> None:
    phone.persona.set_model(HOSTILE)
    phone.persona.set_property("ro.soc.model", HOSTILE)
    phone.persona.set_dumpsys("battery", HOSTILE * 50)
    phone.persona.set_dumpsys("thermalservice", "Thermal Status: 9999\n" + HOSTILE * 50)
    phone.persona.set_counter("kgsl/kgsl-3d0/gpuclk", HOSTILE.encode(errors="replace").decode())
    phone.persona.set_counter("thermal/thermal_zone1 $(id)/type", "gpu")
    phone.persona.set_counter("thermal/thermal_zone1 $(id)/temp", "1")
    phone.persona.set_flood(stdout=4_000_000, stderr=4_000_000)
    device = host.device()
    assert device["name"].startswith("$(touch /data/local/tmp/owned)`id`")
    measured = host.measure(plan(), 2, nothing)
    assert measured.samples is not None
    for text in texts([device, measured.samples]):
        assert text.isprintable()
        assert len(text) <= 200
    assert measured.samples["throttled"] is None
    assert measured.samples["counters"]["gpu_temp"]["file"] == "/sys/class/kgsl/kgsl-3d0/temp"
    assert_as_found(phone)


def texts(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for pair in value.items() for one in pair for text in texts(one)]
    if isinstance(value, list):
        return [text for one in value for text in texts(one)]
    return [value] if isinstance(value, str) else []


def test_what_an_earlier_run_left_is_cleared_and_nothing_else(
    host: AgentHost, adb: AdbServer, phone: StandInPhone
) -> None:
    device = adb.client().device(phone.serial)
    run(
        device, f"mkdir -p {FOLDER}/deep/er; echo old | tee {FOLDER}/record {FOLDER}/deep/er/file >/data/local/tmp/kept"
    )
    stubborn = "trap '' HUP INT TERM PIPE; while :; do sleep 0.1; done"
    with (
        open_shell(device, f'exec sh -c "{stubborn}" {MAIN} run'),
        open_shell(device, f'exec sh -c "{stubborn}" {MAIN}ly run'),
    ):
        wait_until(lambda: len([one for one in phone.processes() if one.command[0] == "sh"]) == 2)
        assert len(agents(phone)) == 1
        assert host.measure(plan(), 1, nothing).image.any()
        assert agents(phone) == []
        assert [one.command[3] for one in phone.processes() if one.command[0] == "sh"] == [f"{MAIN}ly"]
    assert [path.name for path in phone.local_tmp.iterdir()] == ["kept"]


def test_a_jar_that_comes_damaged_does_not_run(
    host: AgentHost, phone: StandInPhone, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged, push = io.BytesIO((BUILD / "agent.jar").read_bytes()[:-1]), Phone.push
    monkeypatch.setattr(Phone, "push", lambda phone, _, remote, doing: push(phone, damaged, remote, doing))
    with pytest.raises(PhoneError, match=r"came to the phone .* damaged"):
        host.probe()
    assert_as_found(phone)


def test_another_version_of_the_agent_is_refused(host: AgentHost, phone: StandInPhone, tmp_path: Path) -> None:
    shutil.copy(BUILD / "agent.jar", tmp_path)
    facts = json.loads((BUILD / "agent.json").read_text())
    (tmp_path / "agent.json").write_text(json.dumps(facts | {"version": "0.0.1"}))
    with pytest.raises(PlanError, match=r"The phone runs agent .*; this is 0\.0\.1"):
        AgentHost(phone.serial, build=tmp_path).probe()


def test_an_agent_that_is_not_built_says_what_to_run(tmp_path: Path) -> None:
    with pytest.raises(PhoneError, match="run `make agent`"):
        AgentHost("127.0.0.1:1", build=tmp_path)
    (tmp_path / "agent.json").write_text('{"version": "1", "sha256": "0"}')
    (tmp_path / "agent.jar").write_bytes(b"other")
    with pytest.raises(PhoneError, match=r"not the one that agent\.json describes"):
        AgentHost("127.0.0.1:1", build=tmp_path)


def test_a_slice_runs_in_a_child(host: AgentHost, phone: StandInPhone) -> None:
    request = Request("cornell-box", Variant(method="compute"), size=(32, 24), frames=2, rounds=1, vs_embree=True)
    task = {"request": request.to_json(), "round": 0, "serial": phone.serial, "via": "shell", "deadline_s": 60.0}
    phases: list[str] = []
    measured = run_child("server.devices.phone_slice", task, 1, 120.0, phases.append)
    assert [phase for phase in phases if phase != "waiting"] == ["preparing", "running", "judging"]
    assert measured["device"]["id"] == phone.serial
    result = combine(request, [measured])
    assert result["frames"] == 2
    assert result["error"]["counts"]["hits"] > 0
    assert result["samples"][0]["counters"]
    assert_as_found(phone)


def test_a_child_tells_a_wrong_serial_in_one_sentence() -> None:
    task = {
        "request": Request("cornell-box").to_json(),
        "round": 0,
        "serial": "$(id)",
        "via": "shell",
        "deadline_s": 9.0,
    }
    with pytest.raises(ChildError, match="no phone's serial"):
        run_child("server.devices.phone_slice", task, 1, 60.0)


def test_bench_measures_on_a_phone(host: AgentHost, phone: StandInPhone) -> None:
    done = bench(f"--device={phone.serial}", "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["device"]["id"] == phone.serial
    assert result["error"]["counts"]["hits"] > 0
    table = bench(f"--device={phone.serial}")
    assert "Stand-in, OpenGL ES 3.1" in table.stdout
    assert_as_found(phone)


@pytest.mark.parametrize("option", ["--device=a b", "--via=usb"])
def test_bench_refuses_what_is_no_phone(option: str) -> None:
    build_agent()
    done = bench("--device=nobody-here", option)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def bench(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "server.cli.app", "bench", "cornell-box", "--size=32", "--frames=1", *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)
