"""The database's server stops and starts: submissions are refused in a sentence, workers wait, nothing is lost."""

from __future__ import annotations

import asyncio
import logging
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from postgres import PostgresCluster, find_binaries, running_cluster
from service_fakes import LEASE_S, Service, running_service, wait_for
from sqlalchemy import select, text

from renderer.child import AsyncSay
from server.queue.ledger import Claim
from server.store.models import Slice

WORKER = Path(__file__).with_name("worker_process.py")
TRAVERSALS = ("bvh-stack", "kd-backtrack", "kd-push-down")


@pytest.fixture
def own_cluster() -> Iterator[PostgresCluster]:
    """A PostgreSQL server that a test may stop; what it commits survives that."""
    binaries = find_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL's server programs are not installed: apt install postgresql")
    with running_cluster(binaries, "synchronous_commit=on") as cluster:
        yield cluster


def submit(service: Service, traversal: str = "bvh-stack") -> int:
    job = service.post("jobs", scene="cornell-box", frames=2, rounds=2, traversal=traversal)
    return int(job["id"])


def gated(
    service: Service, running: threading.Event, go_on: threading.Event
) -> Callable[[Claim, AsyncSay], Awaitable[dict[str, Any]]]:
    """What measures a slice: it says that it is `running`, and gives its measurement once told to `go_on`."""

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        running.set()
        await asyncio.to_thread(go_on.wait)
        return await service.bench.run_slice(held, say)

    return run_slice


def test_it_is_waited_for_and_nothing_is_lost(
    own_cluster: PostgresCluster, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "rayfarm")
    running, go_on = threading.Event(), threading.Event()
    with own_cluster.database() as url, running_service(tmp_path, url) as service:
        jobs = [submit(service, traversal) for traversal in TRAVERSALS]
        with service.working(gated(service, running, go_on)) as worker:
            assert running.wait(20)
            own_cluster.stop()
            assert_unavailable(service)
            go_on.set()  # What was measured meanwhile is kept until it can be recorded.
            time.sleep(LEASE_S + 2)
            assert_unavailable(service)
            own_cluster.start()
            for job in jobs:
                wait_for(lambda job=job: service.get(f"jobs/{job}")["state"] == "done", 60)  # type: ignore[misc]
            assert not worker.given_up
            after = submit(service)
            wait_for(lambda: service.get(f"jobs/{after}")["state"] == "done", 60)
        with service.database.reading() as session:
            assert {part.attempts for part in session.scalars(select(Slice))} == {1}
        assert len(service.bench.order) == 2 * len([*jobs, after])
    said = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert [line for line in said if "Traceback" in line] == []
    assert 1 <= sum("which is waited for" in line for line in said) <= 6, said
    assert "the database answers again" in caplog.text


def test_a_worker_may_be_stopped_meanwhile_and_its_slice_is_measured_by_the_next(
    own_cluster: PostgresCluster, tmp_path: Path
) -> None:
    with own_cluster.database() as url, running_service(tmp_path, url) as service:
        job = submit(service)
        mark = tmp_path / "measuring"
        with subprocess.Popen([sys.executable, WORKER, url, mark, str(LEASE_S)]) as worker:
            wait_for(mark.exists)
            own_cluster.stop()
            time.sleep(3)  # by when its watch for cancelled slices tries again and again
            worker.send_signal(signal.SIGTERM)
            try:
                assert worker.wait(60) == 0
            finally:
                worker.kill()
        own_cluster.start()
        with service.working():
            wait_for(lambda: service.get(f"jobs/{job}")["state"] == "done", 60)


def test_what_was_taken_and_not_begun_is_put_back(own_cluster: PostgresCluster, tmp_path: Path) -> None:
    """The queue's answer to a taking can be lost with the connection: it counts a slice as taken that nobody has."""
    running, go_on = threading.Event(), threading.Event()
    with own_cluster.database() as url, running_service(tmp_path, url) as service:
        first = service.post("jobs", scene="cornell-box", frames=1)["id"]
        with service.working(gated(service, running, go_on)) as worker:
            assert running.wait(20)
            second = service.post("jobs", scene="forest", frames=1)["id"]
            taken = (
                "UPDATE dbos.workflow_status SET status = 'PENDING', executor_id = :worker WHERE status = 'ENQUEUED'"
            )
            with service.database.writing() as session:
                assert session.execute(text(taken), {"worker": worker.name}).rowcount == 1  # type: ignore[attr-defined]
            go_on.set()
            wait_for(lambda: service.get(f"jobs/{first}")["state"] == "done")
            time.sleep(1)
            assert service.get(f"jobs/{second}")["state"] == "queued"
            own_cluster.stop()
            time.sleep(1)
            own_cluster.start()
            wait_for(lambda: service.get(f"jobs/{second}")["state"] == "done", 60)
        assert len(service.bench.order) == 2


def assert_unavailable(service: Service) -> None:
    """Whatever needs the database is answered 503 with a sentence, in time; the process is alive."""
    for path in ("/readyz", "/metrics", "/api/v1/jobs"):
        answer = service.client.get(path)
        assert answer.status_code == 503, (path, answer.text)
        assert answer.json()["detail"].startswith("The database does not answer")
    answer = service.client.post("/api/v1/jobs", json={"scene": "cornell-box", "frames": 1})
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
    assert answer.json()["detail"] == "The database does not answer: send this again in a moment."
    page = service.client.get("/devices", headers={"accept": "text/html"})
    assert page.status_code == 503
    assert "The database does not answer" in page.text
    assert service.client.get("/livez").status_code == 200
