"""Workers and the server are killed and frozen at random; no job is lost, doubled or run beside another."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import func, select

from server.cli.service import GIVEN_UP
from server.devices.registry import TWIN
from server.service import address, listen
from server.store.database import Database
from server.store.models import Change, Device, Job, Result, Slice, Worker, now

HERE = Path(__file__).parent
DEVICES = ("left", "middle", "right")
WORKERS = 4
LEASE_S = 4.0


@pytest.mark.parametrize("seed", [1])
def test_a_short_chaos(database_url: str, tmp_path: Path, seed: int) -> None:
    _chaos(database_url, tmp_path, seed, jobs=30, bound_s=150)


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 3])
def test_a_long_chaos(database_url: str, tmp_path: Path, seed: int) -> None:
    _chaos(database_url, tmp_path, seed, jobs=200, bound_s=900)


def _chaos(url: str, folder: Path, seed: int, jobs: int, bound_s: float) -> None:
    log = folder / "log"
    log.touch()
    database = Database(url)
    rng = random.Random(seed)
    with _farm(url, log, database) as farm:
        _wait_for_workers(database)
        with database.writing() as session:
            session.add_all(Device(id=name, kind=TWIN, host="chaos", presence="online", facts={}) for name in DEVICES)
        farm.submit(jobs)
        deadline = time.monotonic() + bound_s
        while _count(database, "done") < jobs:
            assert time.monotonic() < deadline, f"{_count(database, 'done')} of {jobs} jobs done in {bound_s} s"
            time.sleep(rng.uniform(2, 3))
            farm.hurt(rng, database)
        _check_records(database, jobs)
    _check_log(log, jobs)
    attempts = _attempts(database)
    print(f"seed {seed}: {jobs} jobs, {farm.kills}, {attempts - jobs} runs repeated")
    assert farm.kills.total() >= 1
    assert _leftovers(log) == []
    database.close()


@dataclass
class Farm:
    """Processes that are started again when they end; `kills` counts what was done to them."""

    url: str
    log: Path
    server: str
    port: int
    running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)
    kills: Counter[str] = field(default_factory=Counter)

    def start(self, name: str) -> None:
        words = ["-m", "server.cli.app", "serve", "--no-worker", "--port", str(self.port)]
        if name != "server":
            words = [str(HERE / "chaos_worker.py"), self.url, str(self.log), str(LEASE_S), str(os.getpid())]
        path = os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")])
        environment = os.environ | {"RAYFARM_DATABASE_URL": self.url, "PYTHONPATH": path}
        errors = self.log.with_name(f"{name}.err").open("ab")
        self.running[name] = subprocess.Popen(
            [sys.executable, *words], env=environment, stdout=subprocess.DEVNULL, stderr=errors
        )
        errors.close()

    def submit(self, jobs: int) -> None:
        """Submit the jobs over HTTP, for each device in turn."""
        traversals = ["bvh-stack", "kd-backtrack", "bvh-parent-link", "kd-push-down", "bvh-restart-trail"]
        with httpx.Client(base_url=self.server, timeout=30, trust_env=False) as client:
            for index in range(jobs):
                body = {
                    "scene": "cornell-box",
                    "traversal": traversals[index % 5],
                    "frames": 1,
                    "device": DEVICES[index % 3],
                }
                assert client.post("/api/v1/jobs", json=body).status_code == 201

    def hurt(self, rng: random.Random, database: Database) -> None:
        """Kill or freeze one process at random; what was frozen past its lease must give up when it wakes."""
        for name, process in list(self.running.items()):
            if process.poll() is not None:
                self.start(name)
        name = rng.choice(["server", *(f"worker-{index}" for index in range(WORKERS))])
        victim = self.running[name]
        if name != "server" and rng.random() < 0.2 and _life(database, victim.pid) is not None:
            self.kills["frozen"] += 1
            victim.send_signal(signal.SIGSTOP)
            time.sleep(LEASE_S * 2)
            victim.send_signal(signal.SIGCONT)
            if _woke_alive(database, victim):
                return
            assert victim.wait(30) == GIVEN_UP
        else:
            self.kills["server" if name == "server" else "worker"] += 1
            children = _children_of(victim.pid)
            victim.kill()
            victim.wait()
            _wait_until_gone(children)
        self.start(name)
        # On a machine so busy that processes are killed faster than they start, nothing would ever run.
        if rng.random() < 0.8:
            self.wait_for(name, database)

    def wait_for(self, name: str, database: Database) -> None:
        """Wait until a process that was started works, or has ended."""
        process, deadline = self.running[name], time.monotonic() + 300
        while process.poll() is None and not self._works(name, database):
            assert time.monotonic() < deadline, f"{name} does not start"
            time.sleep(0.05)

    def _works(self, name: str, database: Database) -> bool:
        if name != "server":
            return _life(database, self.running[name].pid) is not None
        try:
            return httpx.get(f"{self.server}/readyz", trust_env=False).is_success
        except httpx.TransportError:
            return False


def _life(database: Database, pid: int) -> Worker | None:
    with database.reading() as session:
        return session.scalar(select(Worker).where(Worker.id.like(f"%:{pid}:%")))


def _woke_alive(database: Database, victim: subprocess.Popen[bytes]) -> bool:
    """Whether a woken worker gives signs of life again and nobody gave it up: it may have been frozen inside a
    transaction that kept all others waiting."""
    woken = now()
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline and victim.poll() is None:
        life = _life(database, victim.pid)
        assert life is not None
        if life.reaped_at is None and life.beat_at > woken:
            return True
        time.sleep(0.05)
    return False


@contextmanager
def _farm(url: str, log: Path, database: Database) -> Iterator[Farm]:
    sock = listen("127.0.0.1", 0)
    farm = Farm(url, log, address(sock), sock.getsockname()[1])
    sock.close()
    try:
        for name in ("server", *(f"worker-{index}" for index in range(WORKERS))):
            farm.start(name)
        farm.wait_for("server", database)
        yield farm
    finally:
        for process in farm.running.values():
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in farm.running.values():
            process.wait(30)


def _wait_for_workers(database: Database) -> None:
    deadline = time.monotonic() + 60
    while True:
        with database.reading() as session:
            if session.scalar(select(func.count()).select_from(Worker)) == WORKERS:
                return
        assert time.monotonic() < deadline, "the workers do not start"
        time.sleep(0.1)


def _check_records(database: Database, jobs: int) -> None:
    with database.reading() as session:
        states = dict(session.execute(select(Job.state, func.count()).group_by(Job.state)).all())
        assert states == {"done": jobs}
        assert session.scalar(select(func.count()).select_from(Result)) == jobs
        done = select(Change.job_id).where(Change.state == "done")
        assert sorted(session.scalars(done)) == sorted(session.scalars(select(Job.id)))


def _check_log(log: Path, jobs: int) -> None:
    """Every start on a device comes after the end, or the death, of the one before it."""
    lines = [line.split() for line in log.read_text().splitlines()]
    assert [line for line in lines if line[0] == "violation"] == []
    assert len({line[1] for line in lines if line[0] == "end"}) == jobs
    inside: dict[str, str] = {}
    for kind, _job, device, pid in lines:
        if kind == "start":
            inside[device] = pid
        else:
            assert inside.pop(device) == pid, "one ended that another had already followed"


def _count(database: Database, state: str) -> int:
    with database.reading() as session:
        return session.scalar(select(func.count()).select_from(Job).where(Job.state == state)) or 0


def _attempts(database: Database) -> Any:
    with database.reading() as session:
        return session.scalar(select(func.sum(Slice.attempts)))


def _children_of(pid: int) -> list[int]:
    """The ids of all processes below one."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents.setdefault(int((entry / "stat").read_text().rpartition(")")[2].split()[1]), []).append(
                    int(entry.name)
                )
            except (FileNotFoundError, ProcessLookupError):
                continue
    found: list[int] = []
    todo = [pid]
    while todo:
        below = parents.get(todo.pop(), [])
        found += below
        todo += below
    return found


def _wait_until_gone(pids: list[int], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while alive := [pid for pid in pids if Path(f"/proc/{pid}/cmdline").exists() and _command(pid)]:
        assert time.monotonic() < deadline, f"children survive their worker: {[_command(pid) for pid in alive]}"
        time.sleep(0.02)


def _leftovers(log: Path) -> list[str]:
    """Commands of this farm's processes that still run."""
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    return [command for pid in pids if str(log) in (command := _command(pid)) or "chaos_slice" in command]


def _command(pid: int) -> str:
    """A process's command line; empty for one that has ended, or is a zombie."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except (FileNotFoundError, ProcessLookupError):
        return ""
