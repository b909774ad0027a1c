"""Studies: planned, submitted, read and cancelled."""

from __future__ import annotations

import logging
from typing import Any

from fastapi import APIRouter, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from server.api.bodies import StudyBody
from server.api.idempotency import Answer, SubmissionOf, answer_once, earlier_answer
from server.api.state import database_of, durable_of
from server.api.study_views import study_view
from server.api.views import find_study
from server.logs import facts
from server.queue.dispatch import require_device, submit
from server.queue.ledger import end_job
from server.scene_list import is_here, require_scene
from server.store.models import Job
from server.store.records import Order, add_study
from server.store.states import OPEN
from server.studies import plan_study

log = logging.getLogger("rayfarm.api")

router = APIRouter(prefix="/api/v1")


@router.post("/studies/plan")
def plan(body: StudyBody, request: Request) -> dict[str, Any]:
    """What a study would be, without queuing it: how many jobs and slices, and what would be left out, with reasons."""
    study = body.to_study()
    with database_of(request).reading() as session:
        for device in study.devices:
            require_device(session, device)
    planned = plan_study(study, require_scene, is_here)
    devices = len(study.devices)
    return {
        "jobs": len(planned.requests) * devices,
        "slices": planned.slices * devices,
        "scenes": list(dict.fromkeys(asked.scene for asked in planned.requests)),
        "devices": list(study.devices),
        "refused": planned.refused,
    }


@router.post("/studies", status_code=201)
def create_study(body: StudyBody, request: Request, submission: SubmissionOf) -> Response:
    """Queue a matrix of variants over scenes; the answer lists what was left out, with reasons."""
    database = database_of(request)
    earlier = earlier_answer(database, submission)
    if earlier is not None:
        return earlier
    study_asked = body.to_study()
    planned = plan_study(study_asked, require_scene, is_here)
    posted = body.model_dump(mode="json", exclude_none=True)
    orders = [Order(asked, device, body.priority) for asked in planned.requests for device in study_asked.devices]

    def create(session: Session) -> Answer:
        study = add_study(session, body.name, posted, planned.refused)
        submit(session, durable_of(request), orders, study.id)
        return Answer(study_view(session, study), f"/api/v1/studies/{study.id}")

    return answer_once(database, submission, create)


@router.get("/studies/{study_id}")
def read_study(study_id: str, request: Request) -> dict[str, Any]:
    """One study with its progress."""
    with database_of(request).reading() as session:
        return study_view(session, find_study(session, study_id))


@router.post("/studies/{study_id}/cancel")
def cancel_study(study_id: str, request: Request) -> dict[str, Any]:
    """Cancel what of a study is still queued or running."""
    with database_of(request).writing() as session:
        study = find_study(session, study_id)
        still_open = select(Job).where(Job.study_id == study.id, Job.state.in_(OPEN)).order_by(Job.id)
        void: list[str] = []
        for job in session.scalars(still_open.with_for_update()):
            void += end_job(session, job, "cancelled", "Cancelled with its study.")
        session.flush()
        view = study_view(session, study)
    durable_of(request).cancel(void)
    log.info("study cancelled", extra=facts(study=view["id"]))
    return view
