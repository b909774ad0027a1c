"""What an idle job waits for, and what to do about a job that ended without a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server import device_words
from server.api.bodies import JobBody
from server.api.device_views import device_view
from server.dashboard.headline import counted
from server.devices.registry import find, live_hosts, ready
from server.store.defaults import LLVMPIPE
from server.store.models import Job, Slice
from server.store.states import HELD, OPEN

Json = dict[str, Any]


@dataclass(frozen=True)
class Wait:
    """Why a job is idle and what would help, and the jobs that run in its place."""

    sentence: str
    running: list[int]


def wait_of(session: Session, job: Job, lease_s: float) -> Wait | None:
    """What a queued or waiting job waits for; None for any other, and for one of which a slice is in hand."""
    if job.state not in ("queued", "waiting") or any(part.state in HELD for part in job.slices):
        return None
    if job.device != LLVMPIPE:
        device = find(session, job.device)
        if device is None or not ready(device):
            return Wait(_away(job.device, device_view(session, device) if device else None), [])
    if not live_hosts(session, lease_s):
        return Wait("It waits for a worker, and none is running: start one with rayfarm worker.", [])
    running, others = _running(session, job), _others(session, job)
    if running:
        return Wait(f"It waits for its turn on {job.device}, {counted(others, 'other open job')} there.", running)
    if others:
        return Wait(f"It waits for its turn on {job.device} with {counted(others, 'other open job')}.", [])
    return Wait("A worker is there and nothing is before it: it starts within seconds.", [])


def body_again(job: Job) -> Json:
    """The body that submits a job's request once more, as a job of its own."""
    asked = {**job.request, **job.request["variant"], "sah": job.request["costs"]}
    known = {name: asked[name] for name in JobBody.model_fields if asked.get(name) is not None}
    return {**known, "device": job.device, "priority": job.priority}


def _away(device: str, view: Json | None) -> str:
    if view is None:
        return f"It waits for {device}, which is not known here: attach it on the page of devices."
    state = device_words.describe_state(view)
    advice = view["set_aside"] or view["advice"] or "See the page of devices."
    return f"It waits for {device}, which is {state}. {advice}"


def _running(session: Session, job: Job) -> list[int]:
    held = select(Job.id).join(Slice).where(Job.device == job.device, Slice.state.in_(HELD)).distinct().order_by(Job.id)
    return list(session.scalars(held))


def _others(session: Session, job: Job) -> int:
    others = (Job.device == job.device, Job.state.in_(OPEN), Job.id != job.id)
    return session.scalar(select(func.count()).select_from(Job).where(*others)) or 0
