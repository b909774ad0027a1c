"""The worker goes on after failures, and loses nothing when it is killed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from service_fakes import Service, running_service

from renderer.child import ChildError
from server import queue
from server.worker import Worker

CHILD = """
import sys, time
from pathlib import Path
from service_fakes import FakeBench
from server.store.database import Database
from server.worker import Stopped, Worker, stop_on_signals

def hang(request, round_index, timeout_s):
    Path(sys.argv[2]).touch()
    time.sleep(60)

stop_on_signals()
database = Database(sys.argv[1])
try:
    Worker(database, hang, FakeBench().combine).run()
except Stopped:
    sys.exit(0)
finally:
    database.close()
"""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


@pytest.fixture
def hanging_worker(service: Service) -> Iterator[Callable[[], subprocess.Popen[bytes]]]:
    """Starts a worker process that holds its first slice for a minute; ends it at the end."""
    started: list[subprocess.Popen[bytes]] = []

    def start() -> subprocess.Popen[bytes]:
        mark = service.folder / f"measuring-{len(started)}"
        url = service.database.engine.url.render_as_string()
        words = [url, str(mark)]
        child = subprocess.Popen([sys.executable, "-c", CHILD, *words], cwd=Path(__file__).parent)
        started.append(child)
        _wait_for(mark.exists)
        return child

    yield start
    for child in started:
        child.kill()
        child.wait()


@pytest.mark.parametrize("error", [ChildError("The shader has no loop."), KeyError("t"), MemoryError()])
def test_a_failing_slice_fails_its_job_alone(service: Service, error: Exception) -> None:
    service.bench.failing = {"kd-push-down": error}
    axes = {"traversal": "kd-push-down,kd-backtrack"}
    study = service.post("studies", name="x", scenes="cornell-box", axes=axes, frames=2, rounds=2)
    service.work()
    after = service.get(f"studies/{study['id']}")
    assert (after["jobs_by_state"]["failed"], after["jobs_by_state"]["done"]) == (1, 1)
    assert after["slices"] == {"done": 2, "ended": 2, "total": 4}
    failed = next(job for job in after["jobs"] if job["state"] == "failed")
    assert str(error).strip("'") in failed["reason"]
    assert service.bench.order.count(("cornell-box", "kd-push-down", 0)) == 1
    assert ("cornell-box", "kd-push-down", 1) not in service.bench.order


def test_a_result_that_cannot_be_made_fails_its_job_alone(service: Service) -> None:
    ids = [service.post("jobs", scene=name, frames=1)["id"] for name in ("cornell-box", "forest")]
    whole = service.bench.combine

    def combine(request, measurements):  # type: ignore[no-untyped-def]
        if request.scene == "cornell-box":
            raise ChildError("The measurements do not fit.")
        return whole(request, measurements)

    worker = Worker(service.database, service.bench.run_slice, combine)
    worker.run_until_idle()
    jobs = [service.get(f"jobs/{number}") for number in ids]
    assert [job["state"] for job in jobs] == ["failed", "done"]
    assert jobs[0]["reason"] == "The measurements do not fit."


def test_a_killed_workers_slice_is_measured_by_the_next(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=2, rounds=2)
    child = hanging_worker()
    child.kill()
    child.wait()
    assert service.get(f"jobs/{job['id']}")["state"] == "running"
    service.work()
    assert service.get(f"jobs/{job['id']}")["state"] == "done"
    assert service.bench.order == [("cornell-box", "bvh-stack", 0), ("cornell-box", "bvh-stack", 1)]


def test_a_stopped_worker_puts_its_slice_back(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    child = hanging_worker()
    child.send_signal(signal.SIGTERM)
    assert child.wait(10) == 0
    claim = queue.claim_slice(service.database, "another:1:x")
    assert claim is not None
    assert claim.job_id == job["id"]


def test_a_slice_that_kills_its_workers_ends_its_job(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    for _ in range(queue.MAX_ATTEMPTS):
        child = hanging_worker()
        child.kill()
        child.wait()
    service.work()
    after = service.get(f"jobs/{job['id']}")
    assert after["state"] == "failed"
    assert "lost its worker 3 times" in after["reason"]
    assert service.bench.order == []


def test_only_the_holder_may_finish_a_slice(service: Service) -> None:
    service.post("jobs", scene="cornell-box", frames=1)
    first = queue.claim_slice(service.database, "elsewhere:1:a")
    assert first is not None
    assert queue.claim_slice(service.database, "elsewhere:2:b") is None
    assert queue.requeue_lost(service.database, lease_s=60) == 0
    assert queue.requeue_lost(service.database, lease_s=0) == 1
    second = queue.claim_slice(service.database, "elsewhere:2:b")
    assert second is not None
    assert not queue.finish_slice(service.database, first, "elsewhere:1:a", {"late": True})
    assert not queue.fail_slice(service.database, first, "elsewhere:1:a", "Too late.")
    assert queue.finish_slice(service.database, second, "elsewhere:2:b", {"late": False})
    measured = queue.measured_jobs(service.database)
    assert [job.measurements for job in measured] == [[{"late": False}]]


def _wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"nothing happened in {seconds} s"
        time.sleep(0.05)
