"""Children on a leash: their answers, their errors, and that they are gone when they must be."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from renderer.child import ChildError, run_child, run_child_async
from renderer.host import DeviceGoneError


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


@pytest.fixture
def pid_file(tmp_path: Path) -> Path:
    return tmp_path / "pid"


def _run(pid_file: Path, timeout_s: float = 30.0, say: Callable[[str], None] | None = None, **task: Any) -> Any:
    return run_child("leashed_work", {"pid": str(pid_file), **task}, 1, timeout_s, say or (lambda _phase: None))


def test_the_answer_and_the_phases_come_up(pid_file: Path) -> None:
    heard: list[str] = []
    big = "x" * 3_000_000
    answer = _run(pid_file, say=heard.append, phases=[["preparing", 0], ["running", 0]], answer=big, end="noise")
    assert answer == {"said": big}
    assert heard == ["preparing", "running"]


@pytest.mark.parametrize(
    ("end", "kind", "sentence"),
    [
        ("spoken", ChildError, r"^The size is 0: give more\.$"),
        ("gone", DeviceGoneError, r"^The phone went away\.$"),
        ("unexpected", ChildError, r"^The run ended with code 1: KeyError: 't'$"),
        (
            "killed",
            ChildError,
            r"^The run was killed, most likely because this machine has no memory left: take",
        ),
    ],
)
def test_an_error_is_a_sentence(pid_file: Path, end: str, kind: type[Exception], sentence: str) -> None:
    with pytest.raises(kind, match=sentence):
        _run(pid_file, end=end)


def test_a_child_ends_at_its_time_limit(pid_file: Path) -> None:
    with pytest.raises(ChildError, match=r"^The run was ended after 1\.5 s, its time limit\.$"):
        _run(pid_file, timeout_s=1.5, phases=[["running", 60]])
    _assert_gone(pid_file)


def test_waiting_does_not_count_against_the_limit(pid_file: Path) -> None:
    assert _run(pid_file, timeout_s=1.5, phases=[["waiting", 2.0], ["running", 0]]) == {"said": None}


def test_a_cancelled_child_is_gone_before_the_cancellation_goes_on(pid_file: Path) -> None:
    async def cancelled_twice() -> None:
        task = {"pid": str(pid_file), "phases": [["running", 60]]}
        running = asyncio.create_task(run_child_async("leashed_work", task, 1, 60, _hear))
        await asyncio.to_thread(_wait_for, pid_file)
        running.cancel()
        await asyncio.sleep(0)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        _assert_gone(pid_file)

    asyncio.run(cancelled_twice())


def test_a_child_ends_when_the_lease_is_lost(pid_file: Path) -> None:
    async def without_lease() -> None:
        task = {"pid": str(pid_file), "phases": [["running", 60]]}
        # Lost once it has begun, however long that took.
        begun = pid_file.exists
        await run_child_async("leashed_work", task, 1, 60, _hear, lease_s=1.0, has_lease=lambda: not begun())

    with pytest.raises(DeviceGoneError, match="gave no sign of life"):
        asyncio.run(without_lease())
    _assert_gone(pid_file)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_child_ends_with_its_worker_killed_or_stopped(pid_file: Path, how: signal.Signals) -> None:
    code = (
        "import asyncio, json, sys\n"
        "from renderer.child import run_child_async\n"
        "async def hear(phase): pass\n"
        "asyncio.run(run_child_async('leashed_work', json.loads(sys.argv[1]), 1, 60, hear, lease_s=1.0))\n"
    )
    task = f'{{"pid": "{pid_file}", "phases": [["running", 60]]}}'
    worker = subprocess.Popen([sys.executable, "-c", code, task])
    try:
        _wait_for(pid_file)
        os.kill(worker.pid, how)
        _assert_gone(pid_file, within_s=5.0)
    finally:
        worker.kill()
        worker.wait()


async def _hear(_phase: str) -> None:
    pass


def _wait_for(pid_file: Path) -> None:
    deadline = time.monotonic() + 20
    while not (pid_file.exists() and pid_file.read_text()):
        assert time.monotonic() < deadline, "the child did not start"
        time.sleep(0.02)


def _assert_gone(pid_file: Path, within_s: float = 0.0) -> None:
    command = Path(f"/proc/{pid_file.read_text()}/cmdline")
    deadline = time.monotonic() + within_s
    while command.exists() and command.read_bytes():
        assert time.monotonic() < deadline, "the child runs on"
        time.sleep(0.02)
