"""Where slices go: to the pool, to the queue of the host that has their device, or nowhere while it is away."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import Select, and_, false, func, literal, not_, or_, select
from sqlalchemy.orm import Session

from server.devices.registry import PAIRING, DeviceError, find, is_ready, ready
from server.queue.durable import POOL, Durable, host_queue
from server.store.database import Database
from server.store.defaults import LLVMPIPE
from server.store.models import Device, Job, Json, Slice
from server.store.records import Order, add_jobs, add_single, change_state
from server.store.states import HELD, OPEN

Target = tuple[str, str | None]
"""A queue and a partition of it."""


def submit(session: Session, durable: Durable, orders: Sequence[Order], study_id: int | None = None) -> list[Job]:
    """Add jobs and enqueue their slices, in the session's transaction; raise DeviceError for one not known."""
    for device in sorted({order.device for order in orders}):
        require_device(session, device)
    slices = add_jobs(session, orders, study_id=study_id)
    put_slices(session, durable, slices)
    return list(dict.fromkeys(part.job for part in slices))


def submit_recommendation(
    session: Session, durable: Durable, scene: str, label: str, request: Json, device: str, priority: int
) -> Job:
    """Add a job of one slice with a request of its own and enqueue it; raise DeviceError for a device not known."""
    require_device(session, device)
    slices = add_single(session, scene, label, request, device, priority)
    put_slices(session, durable, slices)
    return slices[0].job


def require_device(session: Session, device: str) -> None:
    """Raise DeviceError for a device that is not known."""
    if device == LLVMPIPE or find(session, device) is not None:
        return
    known = ", ".join([LLVMPIPE, *session.scalars(select(Device.id).where(Device.kind != PAIRING).order_by(Device.id))])
    raise DeviceError(f"There is no device {device!r}: choose one of {known}, or attach it (`rayfarm devices attach`).")


def put_slices(session: Session, durable: Durable, slices: Sequence[Slice], delay_s: float = 0.0) -> None:
    """Enqueue slices in the session's transaction; one whose device is not ready waits for it instead."""
    targets = {device: _target(session, device) for device in {part.job.device for part in slices}}
    with session.no_autoflush:  # All their changes are written at once.
        _put(session, durable, slices, targets, delay_s)


def _put(
    session: Session, durable: Durable, slices: Sequence[Slice], targets: dict[str, Target | None], delay_s: float
) -> None:
    for part in slices:
        target = targets[part.job.device]
        if target is None:
            park(session, part)
            continue
        queue, partition = target
        part.state, part.worker, part.queue = "queued", None, queue
        part.workflow = durable.put(session, part.id, queue, partition, part.job.priority, delay_s)


def park(session: Session, part: Slice) -> str | None:
    """Let a slice that nobody holds wait for its device; return the workflow to cancel once that is committed."""
    workflow, part.state, part.workflow, part.queue, part.worker = part.workflow, "waiting", None, None, None
    show_if_waiting(session, part.job)
    return workflow


def show_if_waiting(session: Session, job: Job) -> bool:
    """Show a job as waiting for its device once one of its slices does and nobody holds another; whether it does."""
    states, reason = {part.state for part in job.slices}, f"{job.device} is not ready."
    waits = "waiting" in states and states.isdisjoint(HELD)
    if waits and job.reason != reason:
        change_state(session, job, "waiting", reason)
    return waits


def settle(database: Database, durable: Durable) -> int:
    """Put slices whose device came back or moved, park those whose device went; return how many.

    Safe to call from any process at any time: each slice is looked at under its job's lock.
    """
    with database.reading() as session:
        if not session.execute(_unsettled().limit(1)).first():
            return 0
    void: list[str | None] = []
    with database.writing() as session:
        # In the order of ids, which is that of submission and of rounds. Rows that are locked are read as they are now:
        # a slice that was claimed since this statement began is not taken for an idle one.
        found = session.scalars(
            _unsettled().order_by(Slice.id).with_for_update(skip_locked=True, of=(Job, Slice))
        ).all()
        for part in found:
            target = _target(session, part.job.device)
            if target is None and part.state == "queued":
                void.append(park(session, part))
            elif target is not None and part.queue != target[0]:
                void.append(part.workflow)
                waited = part.state == "waiting"
                put_slices(session, durable, [part])
                if waited and part.job.state == "waiting":
                    change_state(session, part.job, "queued", f"{part.job.device} is ready.")
    durable.cancel([workflow for workflow in void if workflow])
    return len(found)


def _target(session: Session, device_id: str) -> Target | None:
    """Where slices for a device go now; None while it is away."""
    if device_id == LLVMPIPE:
        return POOL, None
    device = session.get(Device, device_id)
    if device is None or device.host is None or not ready(device):
        return None
    return host_queue(device.host), device.id


def _unsettled() -> Select[Slice]:
    """Slices that nobody holds and that are not where they belong."""
    here = func.coalesce(is_ready(), false())
    misplaced = or_(Slice.state == "waiting", Slice.queue != literal(host_queue("")) + Device.host)
    pooled = and_(Job.device == LLVMPIPE, Slice.state == "waiting")
    placed = and_(Job.device != LLVMPIPE, or_(and_(here, misplaced), and_(not_(here), Slice.state == "queued")))
    return (
        select(Slice)
        .join(Job)
        .join(Device, Device.id == Job.device, isouter=True)
        .where(Slice.state.in_(("queued", "waiting")), Job.state.in_(OPEN), or_(pooled, placed))
    )
