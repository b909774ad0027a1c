"""A soak: a whole farm under jobs for an hour; memory stays flat, and no process, file or lock is left.

`make test-soak ARGS='--minutes 10'` is shorter. It prints what it saw, and ends by itself.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pytest

from agent_android.standin.adb_server import AdbServer
from agent_android.standin.phone import StandInPhone
from phones.agent_phones import build_agent
from phones.conftest import started
from phones.farm import SOON_S, Farm, Json, _below, _words, farming
from phones.standin_helpers import wait_until
from server.store.states import OPEN

PER_MINUTE = 10
"""The least that must be measured: 600 jobs an hour."""
OPEN_PER_DEVICE = 2
SLICE_TIMEOUT_S = 300.0
"""None is to reach it, however busy the machine is."""
SAMPLE_S = 10.0
TRAVERSALS = ("bvh-stack", "kd-backtrack", "bvh-parent-link", "kd-push-down", "bvh-restart-trail")
GROWTH, GROWTH_MB = 1.1, 8.0
"""How much a process's median memory in the last quarter may exceed that in the second, which is warm."""
SLACK = 3
"""Open files and threads at the end beyond the most of the first half: one connection to SQLite has three files."""


@dataclass(frozen=True)
class Sample:
    """A process at one time: its resident memory in MB, its open files, its threads."""

    memory_mb: float
    files: int
    threads: int


@pytest.fixture
def farm(adb: AdbServer, tmp_path: Path) -> Iterator[Farm]:
    build_agent()
    with (
        started(StandInPhone(tmp_path / "a")) as one,
        started(StandInPhone(tmp_path / "b")) as other,
        farming(adb, (one, other), tmp_path, SLICE_TIMEOUT_S) as farm,
    ):
        yield farm


@pytest.mark.long
def test_an_hour_of_jobs_leaves_nothing_behind(farm: Farm, request: pytest.FixtureRequest) -> None:
    minutes = float(request.config.getoption("minutes"))
    devices = ("llvmpipe", *(phone.serial for phone in farm.phones))
    for device in devices:  # What is loaded once is loaded.
        wait_until_done(farm, [submit(farm, device, number) for number in range(2)])
    before, left_before = standing(farm), leftovers()
    samples: dict[str, list[Sample]] = {name: [] for name in before}
    submitted = soak(farm, devices, minutes, samples)
    wait_until_done(farm, submitted)
    ended = [farm.get(f"jobs/{number}") for number in submitted]
    states = Counter(job["state"] for job in ended)
    report(samples, before, states, minutes)
    assert states == {"done": len(submitted)}, Counter(job["reason"] for job in ended)
    assert len(submitted) >= PER_MINUTE * minutes
    wait_until(lambda: standing(farm).keys() == before.keys(), SOON_S)
    after = standing(farm)
    for name, sample in after.items():
        # Pools of connections and of threads fill up to their sizes: what is warm has them full.
        warm_samples = [before[name], *samples[name][: len(samples[name]) // 2]]
        assert sample.files <= max(one.files for one in warm_samples) + SLACK, (name, before[name], sample)
        assert sample.threads <= max(one.threads for one in warm_samples) + SLACK, (name, before[name], sample)
    for name, seen in samples.items():
        warm, last = memory(seen, 1), memory(seen, 3)
        assert last <= warm * GROWTH + GROWTH_MB, f"{name} grew from {warm:.0f} to {last:.0f} MB"
    assert leftovers() == left_before
    assert held_locks() == []


def soak(farm: Farm, devices: Sequence[str], minutes: float, samples: dict[str, list[Sample]]) -> list[int]:
    """Keep every device busy for so long, and sample what stands; the ids of the jobs."""
    submitted: list[int] = []
    open_jobs: dict[int, str] = {}
    end, sampled = time.monotonic() + 60 * minutes, 0.0
    while time.monotonic() < end:
        open_jobs = {number: device for number, device in open_jobs.items() if is_open(farm.get(f"jobs/{number}"))}
        for device in devices:
            while list(open_jobs.values()).count(device) < OPEN_PER_DEVICE:
                number = submit(farm, device, len(submitted))
                submitted.append(number)
                open_jobs[number] = device
        if time.monotonic() - sampled >= SAMPLE_S:
            sampled = time.monotonic()
            for name, sample in standing(farm).items():
                samples.setdefault(name, []).append(sample)
        time.sleep(1)
    return submitted


def submit(farm: Farm, device: str, number: int) -> int:
    body: Json = {"scene": "cornell-box", "size": 16, "frames": 1, "check": "none", "method": "compute"}
    return int(farm.post("jobs", device=device, traversal=TRAVERSALS[number % len(TRAVERSALS)], **body)["id"])


def is_open(job: Json) -> bool:
    return job["state"] in OPEN


def wait_until_done(farm: Farm, numbers: Sequence[int]) -> None:
    for number in numbers:
        wait_until(lambda number=number: not is_open(farm.get(f"jobs/{number}")), SLICE_TIMEOUT_S)  # type: ignore[misc]


def standing(farm: Farm) -> dict[str, Sample]:
    """The server and its worker, by name; any process below them that measures nothing, by its command line."""
    pids = [farm.serving.pid, *_below(farm.serving.pid)]
    children = set(farm.children())
    found = {}
    for pid in pids:
        words = _words(pid)
        passing = any(name in words for name in ("renderer.", "server.devices.", "resource_tracker"))
        if words and pid not in children and not passing:
            sample = look(pid)
            if sample is not None:
                found["serve" if " serve " in words else "worker" if " worker" in words else words[:80]] = sample
    return found


def look(pid: int) -> Sample | None:
    """A process; None when it has just ended."""
    try:
        status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
        return Sample(int(status["VmRSS"].split()[0]) / 1024, files, int(status["Threads"]))
    except (OSError, KeyError):
        return None


def memory(samples: Sequence[Sample], quarter: int) -> float:
    """The median memory in a quarter, counted from 0, of the samples."""
    quarters = len(samples) / 4
    return median(sample.memory_mb for sample in samples[int(quarter * quarters) : int((quarter + 1) * quarters)])


def leftovers() -> list[str]:
    """Our temporary files and folders."""
    return sorted(path.name for path in Path(tempfile.gettempdir()).glob("rayfarm-*") if path.suffix != ".lock")


def held_locks() -> list[str]:
    """The locks of devices that somebody holds."""
    held = []
    for path in Path(tempfile.gettempdir()).glob("rayfarm-*.lock"):
        handle = os.open(path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            held.append(path.name)
        finally:
            os.close(handle)
    return held


def report(samples: dict[str, list[Sample]], before: dict[str, Sample], states: Counter[str], minutes: float) -> None:
    print(f"\n{dict(states)} in {minutes:g} minutes, {sum(states.values()) / minutes:.1f} a minute")
    for name, seen in samples.items():
        if len(seen) >= 4:
            quarters = ", ".join(f"{memory(seen, quarter):.0f}" for quarter in range(4))
            files, threads = ([getattr(sample, what) for sample in seen] for what in ("files", "threads"))
            start = before.get(name)
            print(f"{name}: {quarters} MB by quarters; files {start and start.files}, at most {max(files)}; "
                  f"threads at most {max(threads)}")  # fmt: skip
