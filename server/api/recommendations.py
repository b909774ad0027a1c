"""Recommendations: asked for, listed and read."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import BeforeValidator, Field
from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.build.tree import SahCosts
from renderer.recommend.halving import ROUNDS
from renderer.recommend.query import ERROR_BUDGET, read_bytes
from scenes.scene import Camera
from server.api.bodies import Axes, Body, CameraBody, Costs, CostsBody, Name, Priority, Size
from server.api.idempotency import Answer, SubmissionOf, answer_once, earlier_answer
from server.api.state import database_of, durable_of
from server.api.views import find_job, iso, job_line
from server.problems import Problem
from server.queue.dispatch import submit_recommendation
from server.recommendations import ASKED, LABEL, Wanted, found_of, job_request, plan_recommendation
from server.scene_list import require_scene
from server.store.defaults import LLVMPIPE, NORMAL_PRIORITY
from server.store.models import Job

router = APIRouter(prefix="/api/v1")


def _read_memory(value: Any) -> Any:
    return read_bytes(value) if isinstance(value, str) else value


Memory = Annotated[int, BeforeValidator(_read_memory)]


class RecommendationBody(Body):
    """What is to be recommended; `axes` as in a study, all values or the default where one is not named."""

    scene: Name
    axes: Axes = Field(default_factory=dict)
    size: Size = (1024, 1024)
    rays: str = "both"
    sah: Costs = CostsBody()
    error_budget: float = Field(ERROR_BUDGET, description="the largest fraction of rays that may be wrong")
    memory_budget: Memory | None = Field(None, description="the most bytes of buffers, a number or as 128M")
    rounds: int = Field(ROUNDS, description="of the confirmation at the full size")
    seed: int = 1
    camera: CameraBody | None = None
    device: Name = LLVMPIPE
    priority: Priority = NORMAL_PRIORITY

    def to_wanted(self) -> Wanted:
        """What is wanted."""
        return Wanted(
            self.scene,
            self.axes,
            self.size,
            self.rays,
            SahCosts(self.sah.traversal, self.sah.intersection),
            self.error_budget,
            self.memory_budget,
            self.rounds,
            self.seed,
            Camera(**self.camera.model_dump()) if self.camera else None,
        )


@router.post("/recommendations", status_code=201)
def create_recommendation(body: RecommendationBody, request: Request, submission: SubmissionOf) -> Response:
    """Queue the search for the fastest variant within budgets; it holds its device while it looks."""
    database = database_of(request)
    earlier = earlier_answer(database, submission)
    if earlier is not None:
        return earlier
    require_scene(body.scene)
    query, refused = plan_recommendation(body.to_wanted())
    asked = job_request(query, refused)

    def create(session: Session) -> Answer:
        job = submit_recommendation(session, durable_of(request), body.scene, LABEL, asked, body.device, body.priority)
        return Answer(recommendation_view(job), f"/api/v1/recommendations/{job.id}")

    return answer_once(database, submission, create)


@router.get("/recommendations")
def list_recommendations(request: Request, limit: int = Query(100, ge=1, le=1000)) -> dict[str, Any]:
    """Recommendations, the newest first, each with its verdict where it is known."""
    with database_of(request).reading() as session:
        return {"recommendations": [recommendation_line(job) for job in latest(session, limit)]}


@router.get("/recommendations/{job_id}")
def read_recommendation(job_id: str, request: Request) -> dict[str, Any]:
    """One recommendation: what was asked, how far it is, and what it came to."""
    with database_of(request).reading() as session:
        return recommendation_view(find_recommendation(session, job_id))


def latest(session: Session, limit: int) -> list[Job]:
    """The latest jobs that are recommendations."""
    wanted = select(Job).where(Job.label == LABEL, Job.study_id.is_(None)).order_by(Job.id.desc()).limit(limit)
    return list(session.scalars(wanted))


def find_recommendation(session: Session, job_id: str) -> Job:
    """A recommendation by the id in a path; raise Problem 404 where there is none."""
    try:
        job = find_job(session, job_id)
    except Problem:
        job = None
    if job is None or ASKED not in job.request:
        raise Problem(404, f"There is no recommendation {job_id}.")
    return job


def recommendation_line(job: Job) -> dict[str, Any]:
    """A recommendation in a list."""
    asked, found = job.request[ASKED]["query"], found_of(job)
    terms = asked["terms"]
    return job_line(job) | {
        "variants": len(asked["variants"]),
        "rays_kind": job.request["rays"],
        "error_budget": terms["error"],
        "memory_budget": terms["memory"],
        "verdict": found and found["verdict"],
        "pick": found and found["pick"],
        "url": f"/api/v1/recommendations/{job.id}",
    }


def recommendation_view(job: Job) -> dict[str, Any]:
    """A recommendation with its history, and what it came to."""
    return recommendation_line(job) | {
        "request": job.request[ASKED]["query"]["request"],
        "refused": job.request[ASKED]["refused"],
        "changes": [{"state": c.state, "reason": c.reason, "at": iso(c.at)} for c in job.changes],
        "recommendation": found_of(job),
    }
