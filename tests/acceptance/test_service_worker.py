"""The worker goes on after failures, and loses nothing when it is killed."""

from __future__ import annotations

import asyncio
import gc
import io
import logging
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from service_fakes import HOST, LEASE_S, Service, document, running_service, wait_for
from sqlalchemy import select, update

from renderer.child import AsyncSay, ChildError
from renderer.host import DeviceGoneError
from renderer.request import Request
from server import worker as service_worker
from server.cli.service import GIVEN_UP
from server.devices import registry
from server.devices.registry import PHONE
from server.queue import care, dispatch, ledger, lives
from server.queue.dispatch import put_slices
from server.queue.ledger import Claim
from server.queue.watch import Watch
from server.store.models import Device, Slice, Worker, now

WORKER = Path(__file__).with_name("worker_process.py")


@pytest.fixture
def service(tmp_path: Path, database_url: str) -> Iterator[Service]:
    with running_service(tmp_path, database_url) as running:
        yield running


@pytest.fixture
def hanging_worker(service: Service) -> Iterator[Callable[[], subprocess.Popen[bytes]]]:
    """Starts a worker process that holds its first slice for a minute; ends it at the end."""
    started: list[subprocess.Popen[bytes]] = []

    def start() -> subprocess.Popen[bytes]:
        mark = service.folder / f"measuring-{len(started)}"
        child = subprocess.Popen([sys.executable, WORKER, service.database_url, mark, str(LEASE_S)])
        started.append(child)
        wait_for(mark.exists)
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

    with service.working(combine=combine) as worker:
        wait_for(worker.is_idle)
    jobs = [service.get(f"jobs/{number}") for number in ids]
    assert [job["state"] for job in jobs] == ["failed", "done"]
    assert jobs[0]["reason"] == "The measurements do not fit."


def test_a_killed_workers_slice_is_measured_by_the_next(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=2, rounds=2)
    child = hanging_worker()
    assert service.get(f"jobs/{job['id']}")["state"] == "preparing"
    child.kill()
    child.wait()
    with service.working():
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    reasons = [change["reason"] for change in service.get(f"jobs/{job['id']}")["changes"]]
    lost = reasons.index("Its worker was lost. Attempt 2 follows.")
    assert "Round 1 of 2 on llvmpipe, attempt 2." in reasons[lost:]
    assert sorted(service.bench.order) == [("cornell-box", "bvh-stack", 0), ("cornell-box", "bvh-stack", 1)]


def test_a_stopped_worker_hands_its_slice_back_at_once(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    child = hanging_worker()
    child.send_signal(signal.SIGTERM)
    assert child.wait(10) == 0
    state = service.get(f"jobs/{job['id']}")
    assert (state["state"], state["reason"]) == ("queued", "Its worker was stopped. Attempt 2 follows.")
    service.work()
    assert service.get(f"jobs/{job['id']}")["state"] == "done"


def test_what_is_taken_while_a_worker_stops_is_measured_by_the_next(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    with service.working() as worker:
        taken, go = hold_up(worker, monkeypatch)
        job = service.post("jobs", scene="cornell-box", frames=1)
        assert taken.wait(10)
        threading.Timer(0.5, go.set).start()
    gc.collect()  # a coroutine that nothing awaited would warn here
    service.work()
    assert service.get(f"jobs/{job['id']}")["state"] == "done"


def test_the_queue_writes_to_no_stream_of_its_own(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """DBOS would keep the first worker's standard error for later ones, which found it closed."""
    with monkeypatch.context() as patch, io.StringIO() as stream:
        patch.setattr(sys, "stderr", stream)
        service.work()
    service.work()
    handlers = logging.getLogger("dbos").handlers
    assert not any(isinstance(each, logging.StreamHandler) for each in handlers), handlers


def test_a_worker_may_stop_while_its_threads_start(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    starting, known = threading.Thread(name="queue-worker-late"), threading.enumerate
    with service.working():
        monkeypatch.setattr(threading, "enumerate", lambda: [*known(), starting])
    service.work()


def test_a_frozen_worker_loses_its_slice_and_cannot_record(
    service: Service, hanging_worker: Callable[[], subprocess.Popen[bytes]]
) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    child = hanging_worker()
    child.send_signal(signal.SIGSTOP)
    with service.working():
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    recorded = service.get(f"jobs/{job['id']}")
    child.send_signal(signal.SIGCONT)
    assert child.wait(20) == GIVEN_UP
    after = service.get(f"jobs/{job['id']}")
    assert after == recorded
    assert service.bench.order == [("cornell-box", "bvh-stack", 0)]


def test_what_a_given_up_worker_takes_is_handed_on_when_it_ends(service: Service) -> None:
    """One that was frozen and wakes up takes what is queued before it learns that it was given up."""
    measuring = threading.Event()

    async def hang(_held: Claim, _say: AsyncSay) -> dict[str, Any]:
        measuring.set()
        await asyncio.sleep(60)
        raise AssertionError("not reached")

    with service.working(hang) as worker:
        assert lives.reap(service.database, service.durable, worker.name, "Its worker was lost.")
        job = service.post("jobs", scene="cornell-box", frames=1)
        wait_for(measuring.is_set)
    service.work()
    assert service.get(f"jobs/{job['id']}")["state"] == "done"


@pytest.mark.parametrize("claimed", [True, False])
def test_what_a_given_up_worker_took_is_handed_on_when_it_is_killed(
    service: Service, monkeypatch: pytest.MonkeyPatch, claimed: bool
) -> None:
    with service.working() as worker:
        taken, go = hold_up(worker, monkeypatch)
        assert lives.reap(service.database, service.durable, worker.name, "Its worker was lost.")
        assert lives.reap_dead(service.database, service.durable, Watch(60)) == 0
        job = service.post("jobs", scene="cornell-box", frames=1)
        assert taken.wait(10)
        if claimed:
            with service.database.reading() as session:
                part = session.scalars(select(Slice)).one()
            assert part.workflow is not None
            assert ledger.claim(service.database, part.id, part.workflow, worker.name) is not None
        # Here or in the server, whose care goes on beside this.
        lives.reap_dead(service.database, service.durable, Watch(60))
        wait_for(lambda: service.durable.held_by(worker.name) == [])
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "queued")
        assert lives.reap_dead(service.database, service.durable, Watch(60)) == 0
        go.set()
    service.work()
    assert service.get(f"jobs/{job['id']}")["state"] == "done"


@pytest.mark.parametrize("days", [3, -3])
def test_a_clock_that_is_set_takes_no_worker_for_dead(
    service: Service, monkeypatch: pytest.MonkeyPatch, days: int
) -> None:
    """The clock of every sign of life, claim and record; the queue's own times are the database's or its library's."""
    job = service.post("jobs", scene="cornell-box", frames=1)
    measuring = asyncio.Event()

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        measuring.set()
        await asyncio.sleep(LEASE_S + 2)
        return await service.bench.run_slice(held, say)

    with service.working(run_slice) as worker:
        wait_for(measuring.is_set)
        for module in (lives, ledger, registry):
            monkeypatch.setattr(module, "now", lambda: now() + timedelta(days=days))
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
        assert not worker.given_up
    with service.database.reading() as session:
        assert [part.attempts for part in session.scalars(select(Slice))] == [1]
        assert abs(session.scalars(select(Worker)).one().beat_at - now()) > timedelta(days=2)


def test_a_slice_that_kills_its_workers_ends_its_job(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger, "MAX_ATTEMPTS", 2)
    job = service.post("jobs", scene="cornell-box", frames=1)
    for name in ("elsewhere:1:a", "elsewhere:2:b"):
        assert take(service, name) is not None
        assert lives.reap_dead(service.database, service.durable, Watch(0)) == 1
    after = service.get(f"jobs/{job['id']}")
    assert after["state"] == "failed"
    assert after["reason"] == "Its worker was lost. That was attempt 2, the last."
    service.work()
    assert service.bench.order == []


def test_only_the_holder_may_record_a_slice(service: Service) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    first = take(service, "elsewhere:1:a")
    assert first is not None
    assert lives.reap_dead(service.database, service.durable, Watch(60)) == 0
    assert lives.reap_dead(service.database, service.durable, Watch(0)) == 1
    assert not lives.beat(service.database, "elsewhere:1:a")
    second = take(service, "elsewhere:2:b")
    assert second is not None
    assert second.attempt == 2

    def combine(measurements: list[dict[str, Any]]) -> dict[str, Any]:
        return document(Request.from_json(second.request), measurements[0]["speed"])

    assert not ledger.enter(service.database, first, "judging")
    assert not ledger.record(service.database, first, {"speed": 1.0}, combine)
    assert not ledger.fail(service.database, service.durable, first, "Too late.")
    assert not ledger.give_back(service.database, service.durable, first, "Too late.")
    assert service.get(f"jobs/{job['id']}")["state"] == "preparing"
    assert ledger.record(service.database, second, {"speed": 2.0}, combine)
    assert not ledger.record(service.database, second, {"speed": 3.0}, combine)
    assert service.get(f"jobs/{job['id']}")["result"]["mrays_per_s"] == 2.0


def test_a_slice_put_anew_is_not_run_by_its_old_workflow(service: Service) -> None:
    service.post("jobs", scene="cornell-box", frames=1)
    with service.database.writing() as session:
        part = session.scalars(select(Slice)).one()
        old = part.workflow
        put_slices(session, service.durable, [part])
        assert old is not None
        assert part.workflow != old
    assert ledger.claim(service.database, part.id, old, "elsewhere:1:a") is None
    service.work()
    assert len(service.bench.order) == 1


def test_a_running_job_that_is_cancelled_ends_and_frees_its_device(service: Service) -> None:
    job = service.post("jobs", scene="cornell-box", traversal="bvh-stack", frames=1)
    other = service.post("jobs", scene="cornell-box", traversal="kd-backtrack", frames=1)
    gone: list[float] = []

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        if held.job_id != job["id"]:
            assert gone, "the next slice started while the cancelled one's child was alive"
            return await service.bench.run_slice(held, say)
        try:
            await say("running")
            await asyncio.sleep(60)
        finally:
            await asyncio.sleep(0.3)
            gone.append(time.monotonic())
        raise AssertionError("not reached")

    with service.working(run_slice):
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "running")
        cancelled = service.client.post(f"/api/v1/jobs/{job['id']}/cancel")
        assert (cancelled.status_code, cancelled.json()["state"]) == (200, "cancelled")
        wait_for(lambda: service.get(f"jobs/{other['id']}")["state"] == "done")
    with service.database.reading() as session:
        held = session.scalars(select(Slice).where(Slice.job_id == job["id"])).one()
        assert (held.state, held.worker) == ("cancelled", None)


def test_a_slice_that_waits_for_a_lock_stays_its_workers(service: Service) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        await say("running")
        await say("waiting")
        await asyncio.sleep(1)
        assert dispatch.settle(service.database, service.durable) == 0
        return await service.bench.run_slice(held, say)

    with service.working(run_slice):
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    states = [change["state"] for change in service.get(f"jobs/{job['id']}")["changes"]]
    assert states == ["queued", "preparing", "running", "waiting", "running", "judging", "done"]


def test_the_more_urgent_job_goes_first(service: Service) -> None:
    for traversal, priority in (("kd-backtrack", 100), ("bvh-stack", 5), ("kd-push-down", 50)):
        service.post("jobs", scene="cornell-box", traversal=traversal, frames=1, priority=priority)
    service.work()
    assert [traversal for _, traversal, _ in service.bench.order] == ["bvh-stack", "kd-push-down", "kd-backtrack"]


def test_a_job_waits_for_its_device_and_follows_it(service: Service) -> None:
    with service.database.writing() as session:
        session.add(Device(id="phone-1", kind=PHONE, host=HOST, presence="offline"))
    job = service.post("jobs", scene="cornell-box", device="phone-1", frames=1)
    assert (job["state"], job["reason"]) == ("waiting", "phone-1 is not ready.")
    with service.working():
        service.post("jobs", scene="cornell-box", frames=1)
        wait_for(lambda: len(service.bench.order) == 1)
        assert service.get(f"jobs/{job['id']}")["state"] == "waiting"
        lives.begin(service.database, "elsewhere:1:a", "elsewhere")
        _set_device(service, presence="online", health={"passed": True}, host="elsewhere")
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "queued")
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "waiting")
        assert service.get("devices/phone-1")["presence"] == "offline", "its host gave no sign of life"
        _set_device(service, presence="online", host=HOST)
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    assert len(service.bench.order) == 2


def test_a_device_that_goes_away_gets_its_slice_again(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ledger, "BACK_OFF_S", 0.1)
    job = service.post("jobs", scene="cornell-box", frames=1)
    tries: list[int] = []

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        tries.append(held.attempt)
        if len(tries) < 3:
            raise DeviceGoneError("The phone went away while the plan was pushed.")
        return await service.bench.run_slice(held, say)

    with service.working(run_slice):
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    assert tries == [1, 2, 3]
    reasons = [change["reason"] for change in service.get(f"jobs/{job['id']}")["changes"]]
    assert "The phone went away while the plan was pushed. Attempt 2 follows." in reasons


def test_a_device_that_goes_away_between_rounds_lets_its_job_wait(service: Service) -> None:
    with service.database.writing() as session:
        session.add(Device(id="phone-1", kind=PHONE, host=HOST, presence="online", health={"passed": True}))
    job = service.post("jobs", scene="cornell-box", device="phone-1", frames=3, rounds=3)

    async def run_slice(held: Claim, say: AsyncSay) -> dict[str, Any]:
        measured = await service.bench.run_slice(held, say)
        if held.round == 0:
            _set_device(service, presence="offline")
            dispatch.settle(service.database, service.durable)
            assert service.get(f"jobs/{job['id']}")["state"] == "judging"
        return measured

    with service.working(run_slice):
        wait_for(lambda: service.get(f"jobs/{job['id']}")["reason"] == "phone-1 is not ready.")
        _set_device(service, presence="online")
        wait_for(lambda: service.get(f"jobs/{job['id']}")["state"] == "done")
    states = [change["state"] for change in service.get(f"jobs/{job['id']}")["changes"]]
    measured = ["preparing", "running", "judging"]
    assert states == ["queued", *measured, "waiting", "queued", *measured, "queued", *measured, "done"]


def test_a_device_that_nobody_knows_is_refused(service: Service) -> None:
    answer = service.client.post("/api/v1/jobs", json={"scene": "cornell-box", "device": "nokia"})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("There is no device 'nokia': choose one of llvmpipe")
    assert service.get("jobs")["jobs"] == []


def test_what_is_over_is_forgotten_by_the_queue_but_not_by_the_store(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = service.post("jobs", scene="cornell-box", frames=2, rounds=2)
    with service.working() as worker:
        wait_for(worker.is_idle)
        wait_for(lambda: service.durable.held_by(worker.name) == [])
    queued = service.post("jobs", scene="cornell-box", frames=1)
    past, future = now() - timedelta(hours=1), now() + timedelta(hours=1)
    assert service.durable.forget_before(past) == 0
    assert service.durable.forget_before(future, most=1) == 1
    assert service.durable.forget_before(future) == 1
    assert service.durable.forget_before(future) == 0
    monkeypatch.setattr(care, "KEPT", -timedelta(hours=1))
    care.tidy(service.database, service.durable)
    with service.database.reading() as session:
        assert session.scalars(select(Worker)).all() == []
    assert service.get(f"jobs/{done['id']}")["state"] == "done"
    service.work()
    assert service.get(f"jobs/{queued['id']}")["state"] == "done"


def hold_up(worker: service_worker.Worker, monkeypatch: pytest.MonkeyPatch) -> tuple[threading.Event, threading.Event]:
    """What the worker takes from the queue it begins late: when it took something, and what lets it go on."""
    taken, go = threading.Event(), threading.Event()
    read = worker._queue._sys_db.get_workflow_statuses

    def late(workflows: list[str]) -> Any:
        if workflows:  # A host's queue asks for none when it took none.
            taken.set()
            go.wait(20)
        return read(workflows)

    monkeypatch.setattr(worker._queue._sys_db, "get_workflow_statuses", late)
    return taken, go


def take(service: Service, worker: str) -> Claim | None:
    """Claim the next slice in the name of a worker, as its workflow would."""
    lives.begin(service.database, worker, "elsewhere")
    with service.database.reading() as session:
        part = session.scalars(select(Slice).where(Slice.state == "queued").order_by(Slice.id)).first()
    assert part is not None
    assert part.workflow is not None
    return ledger.claim(service.database, part.id, part.workflow, worker)


def _set_device(service: Service, **values: Any) -> None:
    with service.database.writing() as session:
        session.execute(update(Device).values(**values))
