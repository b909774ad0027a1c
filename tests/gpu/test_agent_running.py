"""How the phone agent times, samples and ends: its record says it all, and nothing of it stays behind."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agent_desktop import Batch, finish, run_words, start, version, words
from running import catalogue_scene, prepared

from renderer.plan import Buffer, Plan
from renderer.variant import Variant
from server.devices.agent_record import AgentRecord, read_record

TIMER = "GL_EXT_disjoint_timer_query"
WRAP = 1 << 32
UNKNOWN = "-1"


@pytest.fixture(scope="module")
def agent() -> Iterator[Batch]:
    with Batch() as batch:
        yield batch


@pytest.fixture(scope="module")
def plan() -> Plan:
    return prepared(catalogue_scene("cornell-box"), Variant("bvh-stack", "hybrid"), (64, 64)).plan(instrument=False)


@pytest.fixture
def plan_file(plan: Plan, tmp_path: Path) -> Path:
    plan.save(tmp_path / "plan")
    return tmp_path / "plan"


# Timing


def test_each_timed_frame_is_recorded(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan, frames=5, warm_up=2)
    assert found.outcome == "done"
    assert len(found.frames) == 5
    assert all(frame.wall > 0 and frame.cpu is not None and not frame.disjoint for frame in found.frames)
    assert all(frame.gpu is not None and frame.gpu <= frame.wall + 1_000_000 for frame in found.frames)
    assert found.compile_ms > 0
    assert found.upload_ms > 0
    assert found.warm_up_ms > 0


def test_without_the_timer_there_is_no_gpu_time(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan, {"RAYFARM_SHIM_EXTENSIONS_OFF": TIMER})
    assert found.outcome == "done"
    assert TIMER not in found.device["extensions"]
    assert [(frame.gpu, frame.disjoint) for frame in found.frames] == [(None, False)]


def test_a_disjoint_frame_has_no_gpu_time(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan, {"RAYFARM_SHIM_DISJOINT": "1"}, frames=2)
    assert [(frame.gpu, frame.disjoint) for frame in found.frames] == [(None, True)] * 2


def test_a_time_that_cannot_be_is_not_recorded(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan, {"RAYFARM_SHIM_TIMER_ADD_NS": "3000000000"})
    assert [frame.gpu for frame in found.frames] == [None]


def test_a_wrapped_time_is_told_by_the_time_to_completion(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan, {"RAYFARM_SHIM_TIMER_ADD_NS": str(WRAP)})
    assert all(frame.gpu is not None and frame.gpu <= frame.wall + 1_000_000 for frame in found.frames)


@pytest.mark.parametrize(
    ("bits", "wall", "expected"),
    [
        (4_000_000, 5_000_000, "4000000"),
        (4_200_000_000, 4_250_000_000, "4200000000"),
        # One second, or 5.29?
        (1_000_000_000, 6_000_000_000, UNKNOWN),
        # Three seconds: 7.29 would be more than the frame took.
        (3_000_000_000, 6_000_000_000, "3000000000"),
        (3_000_000_000, 5_000_000, UNKNOWN),
        # What a driver that does not wrap answers when it cannot say.
        (WRAP - 1, 5_000_000_000, UNKNOWN),
    ],
)
def test_32_bits_are_read_as_a_time_where_only_one_is_possible(
    agent: Batch, bits: int, wall: int, expected: str
) -> None:
    assert agent.ask({"certain": [bits, wall]}) == expected


# Counters


def test_counters_are_read_after_every_frame(agent: Batch, plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "clock").write_text("  585000000 \n")
    (tmp_path / "long").write_text("x" * 5000)
    (tmp_path / "empty").write_text("")
    names = ("clock", "long", "empty", "absent", ".")
    counters = [word for name in names for word in ("--sample", f"{name}={tmp_path / name}")]
    found = agent.run(plan, None, *counters, frames=3)
    assert found.samples["clock"] == {"file": str(tmp_path / "clock"), "values": ["585000000"] * 3}
    assert found.samples["long"]["values"] == ["x" * 96] * 3
    assert found.samples["empty"]["values"] == [None] * 3
    assert set(found.unavailable) == {"absent", "."}
    assert "No such file" in found.unavailable["absent"]


def test_a_probe_tells_device_precision_and_counters(agent: Batch, tmp_path: Path) -> None:
    (tmp_path / "temp").write_text("31000\n")
    counters = ("--sample", f"temp={tmp_path / 'temp'}", "--sample", "clock=/nowhere")
    found = agent.record("probe", {"RAYFARM_SHIM_LIMITS": "MAX_IMAGE_UNITS=5"}, *counters)
    assert found.outcome == "done"
    assert found.samples["temp"]["values"] == ["31000"]
    assert list(found.unavailable) == ["clock"]
    assert found.device["gl_version"].startswith("OpenGL ES 3.1")
    assert found.device["limits"]["IMAGE_UNITS"] == 5
    assert found.device["android"]["sdk"] == 29
    assert set(found.device["precision"]) == {"compute", "fragment"}
    wrong = {
        stage: {name for name, answer in operations.items() if answer["wrong"]}
        for stage, operations in found.device["precision"].items()
    }
    # llvmpipe flushes denormals in its rasteriser's threads.
    assert wrong["compute"] == set()
    assert wrong["fragment"] <= {"denormal"}
    assert found.device["precision"]["fragment"]["add"] == {"cases": 64, "wrong": 0, "max_ulp": 0}


# Ending


def record(folder: Path, token: str = "t") -> AgentRecord:
    return read_record(folder / "out", token, version())


def commanded(folder: Path, plan_file: Path, frames: int = 2, deadline: float = 60) -> list[str]:
    return [*words("run", folder / "out", "t", deadline), *run_words(plan_file, frames)]


def test_phases_are_told_and_the_record_is_whole(plan_file: Path, tmp_path: Path) -> None:
    code, out, err = finish(start(commanded(tmp_path, plan_file)))
    assert (code, err) == (0, "")
    assert out.splitlines() == [f"rayfarm {phase}" for phase in ("ready", "compiled", "frame 1", "frame 2", "done")]
    assert record(tmp_path).outcome == "done"
    assert {file.name for file in tmp_path.iterdir()} == {"out", "plan"}


def test_a_hung_driver_ends_at_the_deadline(plan_file: Path, tmp_path: Path) -> None:
    """The fifth wait is the first timed frame's: uploads, two passes, one more warm-up frame."""
    begun = time.monotonic()
    hung = [*commanded(tmp_path, plan_file, deadline=2), "--warm-up", "2"]
    code, out, _ = finish(start(hung, {"RAYFARM_SHIM_HANG": "finish:5"}))
    assert code == 1
    assert time.monotonic() - begun < 30
    assert out.splitlines()[-1] == "rayfarm done"
    found = record(tmp_path)
    assert (found.outcome, found.reason, found.frames, found.blobs) == (
        "deadline",
        "The run did not end within its deadline of 2.0 s: it was running frame 1.",
        (),
        (),
    )
    assert found.device["gl_renderer"].startswith("llvmpipe")
    assert {file.name for file in tmp_path.iterdir()} == {"out", "plan"}


def test_frames_before_the_deadline_are_kept(plan_file: Path, tmp_path: Path) -> None:
    finish(start(commanded(tmp_path, plan_file, deadline=3), {"RAYFARM_SHIM_HANG": "finish:5"}))
    found = record(tmp_path)
    assert (found.outcome, len(found.frames)) == ("deadline", 1)


def test_a_caller_that_is_gone_ends_it_and_nothing_stays(plan_file: Path, tmp_path: Path) -> None:
    (tmp_path / "out.part").write_text("of an earlier run")
    process = start(commanded(tmp_path, plan_file), {"RAYFARM_SHIM_HANG": "finish:2"})
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stdout.readline() == "rayfarm ready\n"
    assert process.stdout.readline() == "rayfarm compiled\n"
    assert process.poll() is None
    process.stdin.close()
    process.stdin = None
    try:
        process.communicate(timeout=20)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    assert process.returncode == 3
    assert {file.name for file in tmp_path.iterdir()} == {"plan"}


def test_another_version_is_refused(agent: Batch, plan_file: Path, tmp_path: Path) -> None:
    given = commanded(tmp_path, plan_file)
    given[given.index("--version") + 1] = "0.0.1+other"
    assert agent.ask({"args": given}) == "1"
    found = record(tmp_path)
    assert found.outcome == "refused"
    assert found.reason == f"This agent is {version()} and the caller wants 0.0.1+other: push the agent again."


def test_what_an_earlier_run_left_is_cleared_first(agent: Batch, plan_file: Path, tmp_path: Path) -> None:
    for name in ("out", "out.blobs", "out.part"):
        (tmp_path / name).write_bytes(b"left" * 1000)
    assert agent.ask({"args": commanded(tmp_path, plan_file)}) == "0"
    assert record(tmp_path).blobs[0].name == "image"
    assert {file.name for file in tmp_path.iterdir()} == {"out", "plan"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("--frames", "many"), "The value 'many' of --frames is out of range"),
        (("--frames", "-1"), "The value '-1' of --frames is out of range"),
        (("--colour", "red"), "There is no option --colour"),
        (("--sample", "temp"), "The sample 'temp' is not CLASS=FILE"),
        (("--token",), "The option --token has no value"),
    ],
)
def test_a_wrong_command_line_is_said(
    agent: Batch, plan_file: Path, tmp_path: Path, change: tuple[str, ...], said: str
) -> None:
    assert said in agent.ask({"args": [*commanded(tmp_path, plan_file), *change]})


def test_main_says_a_wrong_command_line_on_standard_error() -> None:
    code, out, err = finish(start(["dance"]))
    assert (code, out) == (2, "")
    assert err == "There is no verb 'dance': see agent_android/README.md for the command line.\n"


def test_a_record_that_cannot_be_written_is_told_by_the_exit_code(plan_file: Path, tmp_path: Path) -> None:
    code, out, err = finish(start(commanded(tmp_path / "nowhere", plan_file)))
    assert code == 1
    assert "rayfarm done" not in out
    assert "No such file" in err


def test_a_heap_smaller_than_the_buffers_is_enough(plan: Plan, tmp_path: Path) -> None:
    """What is uploaded and read back passes the Java heap by; Android's is small."""
    size = 48 << 20
    first = replace(plan.passes[-1], collect="much")
    buffers = (*plan.buffers, Buffer("much", size, np.arange(size // 4, dtype=np.uint32)))
    replace(plan, buffers=buffers, passes=(*plan.passes[:-1], first)).save(tmp_path / "plan")
    given = commanded(tmp_path, tmp_path / "plan")
    code, _, err = finish(start(given, {"JDK_JAVA_OPTIONS": "-Xmx24m"}))
    assert (code, err) == (0, "NOTE: Picked up JDK_JAVA_OPTIONS: -Xmx24m\n")
    (blob,) = record(tmp_path).blobs
    assert len(blob.data) == size
    assert bytes(blob.data[-4:]) == (size // 4 - 1).to_bytes(4, "little")
