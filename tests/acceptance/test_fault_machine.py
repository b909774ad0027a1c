"""Faults of a machine under a whole `rayfarm serve`: a full disk, no memory, two servers on one file."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from service_fakes import wait_for

from server.service import address, listen

Json = dict[str, Any]
SERVE = [sys.executable, "-m", "server.cli.app", "serve"]
JOB: Json = {"scene": "cornell-box", "size": 16, "frames": 1, "check": "none", "method": "compute"}
SOON_S = 120.0
"""Patience with what takes seconds here; the machine may be busy."""


class Served:
    """A `rayfarm serve` with its worker, and a client."""

    def __init__(self, process: subprocess.Popen[bytes], client: httpx.Client, log: Path) -> None:
        self.process, self.client, self.log = process, client, log

    def submit(self, **body: Any) -> int:
        answer = self.client.post("/api/v1/jobs", json=JOB | body)
        assert answer.status_code == 201, answer.text
        return int(answer.json()["id"])

    def job(self, number: int) -> Json:
        found: Json = self.client.get(f"/api/v1/jobs/{number}").json()
        return found

    def ended(self, number: int) -> Json:
        wait_for(lambda: self.job(number).get("state") in ("done", "failed"), SOON_S)
        return self.job(number)

    def answers(self) -> bool:
        try:
            return self.client.get("/readyz").is_success
        except httpx.TransportError:
            return False


@contextmanager
def serving(database: Path, before: Sequence[str] = (), **environment: str) -> Iterator[Served]:
    """`rayfarm serve` on an SQLite file, its command after the words `before`."""
    sock = listen("127.0.0.1", 0)
    base, port = address(sock), sock.getsockname()[1]
    sock.close()
    log = database.with_name(f"{port}.log")
    settings = {"RAYFARM_DATABASE_URL": f"sqlite:///{database}", "RAYFARM_BLOBS": str(database.parent / "blobs")}
    command = [*before, *SERVE, "--port", str(port), "--json"]
    with (
        log.open("wb") as out,
        subprocess.Popen(command, env=os.environ | settings | environment, stdout=out, stderr=out) as process,
        httpx.Client(base_url=base, timeout=60, trust_env=False) as client,
    ):
        served = Served(process, client, log)
        try:
            wait_for(served.answers, SOON_S)
            yield served
            process.send_signal(signal.SIGTERM)
            assert process.wait(60) == 0
        finally:
            process.kill()


def test_a_full_disk_refuses_in_a_sentence_and_goes_on_when_there_is_space(tmp_path: Path) -> None:
    folder = tmp_path / "small"
    folder.mkdir()
    mount = f'mount -t tmpfs -o size=6m,mode=777 rayfarm "{folder}" && exec "$@"'
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", mount, "sh"]
    if shutil.which("unshare") is None or subprocess.run([*words, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine lets no user mount a small file system")
    database = folder / "farm.sqlite"
    with serving(database, words, RAYFARM_BLOBS=str(tmp_path / "blobs")) as served:
        # The mount is the server's own; its folder is seen through its root.
        inside = Path(f"/proc/{served.process.pid}/root{folder}")
        before = served.ended(served.submit())
        assert before["state"] == "done", before["reason"]
        fill(inside / "ballast")
        refused = [served.client.post("/api/v1/studies", json=study()) for _ in range(3)]
        assert {answer.status_code for answer in refused} == {503}, [answer.text for answer in refused]
        sentences = {answer.json()["detail"] for answer in refused}
        assert any("disk of the database is full, and nothing was changed" in sentence for sentence in sentences)
        assert served.job(before["id"])["state"] == "done", "what is stored can be read"
        assert len(served.client.get("/api/v1/jobs").json()["jobs"]) == 1
        (inside / "ballast").unlink()
        after = served.ended(served.submit())
        assert after["state"] == "done", after["reason"]
        assert len(served.client.get("/api/v1/jobs").json()["jobs"]) == 2


def fill(path: Path) -> None:
    """Write until nothing more fits."""
    with path.open("wb", buffering=0) as file:
        for size in (1 << 16, 1 << 10, 1):
            try:
                while file.write(bytes(size)):
                    pass
            except OSError:
                continue


def study() -> Json:
    axes = {"traversal": "all", "layout": "all"}
    return {"name": "x", "scenes": "cornell-box", "size": 16, "frames": 4, "rounds": 4, "check": "none", "axes": axes}


def test_a_slice_that_takes_too_much_memory_fails_alone(tmp_path: Path) -> None:
    with serving(tmp_path / "farm.sqlite", RAYFARM_SLICE_MEMORY_MB="600") as served:
        large = served.submit(scene="forest:2000000", size=64)
        small = served.submit(priority=200)
        failed = served.ended(large)
        assert failed["state"] == "failed"
        assert "want of memory beyond the 600 MB that it may take" in failed["reason"]
        assert served.ended(small)["state"] == "done"


def test_two_servers_on_one_sqlite_file_share_the_work(tmp_path: Path) -> None:
    database = tmp_path / "farm.sqlite"
    with serving(database, RAYFARM_WORKER_HOST="one") as one, serving(database, RAYFARM_WORKER_HOST="two") as two:
        numbers = [served.submit(traversal=name) for name in ("bvh-stack", "kd-backtrack") for served in (one, two)]
        for number in numbers:
            assert one.ended(number)["state"] == "done"
            assert two.job(number) == one.job(number)
        assert len(set(numbers)) == 4
        changes = [change["state"] for number in numbers for change in one.job(number)["changes"]]
        assert changes.count("done") == 4
        rows = two.client.get("/api/v1/compare?format=csv").text.splitlines()
        assert len(rows) == 1 + 4
        for served in (one, two):
            assert "locked" not in served.log.read_text()
