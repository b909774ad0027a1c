"""PostgreSQL's disk fills up: its tables find no room, or its log finds none and it falls; nothing accepted is lost."""

from __future__ import annotations

import asyncio
import pwd
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest
from postgres import PostgresCluster, find_binaries, running_cluster
from service_fakes import LEASE_S, Service, running_service, wait_for
from sqlalchemy import select

from renderer.child import AsyncSay
from server.queue.ledger import Claim
from server.store.models import Slice

JOB = {"scene": "cornell-box", "frames": 2, "rounds": 2}
STUDY = {"name": "x", "scenes": "cornell-box", "size": 16, "axes": {"traversal": "all", "layout": "all"}}
SIZE_MB = 192
FULL = "The disk of the database is full, and nothing was changed: free space there, then send this again."
AWAY = "The database does not answer: send this again in a moment."


class Disk:
    """A PostgreSQL server whose data is all that lies on a small disk."""

    def __init__(self, cluster: PostgresCluster, folder: Path) -> None:
        assert cluster.keeper is not None
        # The mount is the server's own; its folder is seen through its root.
        self.cluster, self.ballast = cluster, Path(f"/proc/{cluster.keeper.pid}/root{folder}/ballast")

    def fill(self) -> None:
        """Write until nothing more fits; the log keeps what files it has."""
        with self.ballast.open("wb", buffering=0) as file:
            for size in (1 << 20, 1 << 12, 1):
                try:
                    while file.write(bytes(size)):
                        pass
                except OSError:
                    continue

    def empty(self) -> None:
        """Make room again."""
        self.ballast.unlink()


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    binaries = find_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL's server programs are not installed: apt install postgresql")
    folder = tmp_path / "small"
    folder.mkdir()
    # PostgreSQL refuses to be root, which who mounts must be: it is somebody else in a namespace of its own.
    user = pwd.getpwnam("nobody")
    mount = f'mount -t tmpfs -o size={SIZE_MB}m,mode=777 rayfarm "$0" && exec unshare --user '
    mount += f'--map-user={user.pw_uid} --map-group={user.pw_gid} env TMPDIR="$0" "$@"'
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", mount, str(folder)]
    if shutil.which("unshare") is None or subprocess.run([*words, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine lets no user mount a small file system")
    with running_cluster(binaries, "synchronous_commit=on", "fsync=on", before=words) as cluster:
        yield Disk(cluster, folder)


class Gate:
    """Measures slices once it is opened."""

    def __init__(self, service: Service) -> None:
        self.reached, self.opened, self._bench = threading.Event(), threading.Event(), service.bench

    async def run_slice(self, held: Claim, say: AsyncSay) -> dict[str, Any]:
        self.reached.set()
        await asyncio.to_thread(self.opened.wait)
        return await self._bench.run_slice(held, say)


def test_full_tables_are_told_and_waited_for(disk: Disk, tmp_path: Path) -> None:
    with disk.cluster.database() as url, running_service(tmp_path, url) as service:
        keep_log_files(url, 4)
        jobs = [submit(service) for _ in range(3)]
        gate = Gate(service)
        with service.working(gate.run_slice) as worker:
            assert gate.reached.wait(20)
            disk.fill()
            taken, sentence = submit_until_refused(service)
            assert sentence == FULL
            assert stored(service) == sorted([*jobs, *taken])
            gate.opened.set()  # What is measured meanwhile is kept until it can be recorded.
            time.sleep(LEASE_S + 1)
            assert disk.cluster.answers()
            assert service.client.get("/readyz").status_code == 200
            disk.empty()
            wait_for(lambda: states(service) == {"done"}, 120)
            assert not worker.given_up
            assert stored(service) == sorted([*jobs, *taken])
        assert service.client.post("/api/v1/studies", json=STUDY).status_code == 201
        check_slices(service, most_attempts=1)


def test_a_server_that_falls_for_want_of_room_loses_nothing(disk: Disk, tmp_path: Path) -> None:
    with disk.cluster.database() as url, running_service(tmp_path, url) as service:
        jobs = [submit(service) for _ in range(3)]
        gate = Gate(service)
        with service.working(gate.run_slice) as worker:
            assert gate.reached.wait(20)
            disk.fill()
            with pytest.raises(psycopg.OperationalError):
                keep_log_files(url, SIZE_MB)  # A log without room ends its server: it can promise nothing then.
            wait_for(lambda: not disk.cluster.answers())
            taken, sentence = submit_until_refused(service)
            assert (taken, sentence) == ([], AWAY)
            assert service.client.get("/readyz").status_code == 503
            gate.opened.set()
            time.sleep(1)
            disk.empty()
            if not disk.cluster.answers():
                disk.cluster.start()  # as systemd and Docker do
            wait_for(lambda: states(service) == {"done"}, 120)
            assert stored(service) == sorted(jobs)
            assert not worker.given_up
        check_slices(service, most_attempts=1)


def submit(service: Service) -> int:
    return int(service.post("jobs", **JOB)["id"])


def submit_until_refused(service: Service) -> tuple[list[int], str]:
    """The jobs of the studies that were taken before one was refused, and what was said of that."""
    taken: list[int] = []
    for _ in range(200):
        answer = service.client.post("/api/v1/studies", json=STUDY)
        if answer.status_code != 201:
            assert (answer.status_code, answer.headers["retry-after"]) == (503, "5"), answer.text
            return taken, answer.json()["detail"]
        taken += [job["id"] for job in answer.json()["jobs"]]
    raise AssertionError("the disk does not fill up")


def stored(service: Service) -> list[int]:
    with service.database.reading() as session:
        return sorted(set(session.scalars(select(Slice.job_id))))


def states(service: Service) -> set[str]:
    with service.database.reading() as session:
        return set(session.scalars(select(Slice.state).distinct()))


def check_slices(service: Service, most_attempts: int) -> None:
    """Each slice was measured, once."""
    with service.database.reading() as session:
        parts = list(session.scalars(select(Slice)))
    assert {part.state for part in parts} <= {"done", "queued"}
    assert max(part.attempts for part in parts) <= most_attempts
    assert len(service.bench.order) == sum(part.state == "done" for part in parts)


def keep_log_files(url: str, count: int) -> None:
    """Have PostgreSQL's log begin this many files, which it uses again."""
    with psycopg.connect(url, autocommit=True) as connection:
        for _ in range(count):
            connection.execute("SELECT pg_logical_emit_message(false, 'a', 'b')")  # An empty file is not switched.
            connection.execute("SELECT pg_switch_wal()")
        connection.execute("CHECKPOINT")
