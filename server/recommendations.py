"""Recommendations as the service keeps them: a job of one slice whose request says what is asked under `recommend`.

The slice holds its device while it looks, so that nothing else runs there; its measurement is the recommendation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from renderer.build.tree import SahCosts
from renderer.recommend.halving import ROUNDS
from renderer.recommend.query import ERROR_BUDGET, Query, make_query
from scenes.scene import Camera
from server.considered import considered
from server.scene_list import is_here, require_scene
from server.store.models import Job, Json
from server.studies import Study, plan_study
from server.study_axes import SETTINGS, StudyError, Words

ASKED = "recommend"
LABEL = "recommendation"


@dataclass(frozen=True)
class Wanted:
    """What is to be recommended: `axes` as in a study, budgets, and how it is confirmed."""

    scene: str
    axes: Mapping[str, Words] = field(default_factory=dict)
    size: tuple[int, int] = (1024, 1024)
    rays: str = "both"
    costs: SahCosts = SahCosts()
    error: float = ERROR_BUDGET
    memory: int | None = None
    rounds: int = ROUNDS
    seed: int = 1
    camera: Camera | None = None


def study_of(wanted: Wanted) -> Study:
    """The matrix that the recommendation chooses from; raise StudyError for an axis that is no variant's."""
    for axis in wanted.axes:
        if axis in SETTINGS:
            raise StudyError(f"The axis {axis} is none that a recommendation chooses from: give one value as {axis}.")
    return Study(
        scenes=(wanted.scene,),
        axes=considered() | dict(wanted.axes),
        size=wanted.size,
        frames=1,
        rounds=1,
        rays=wanted.rays,
        costs=wanted.costs,
    )


def plan_recommendation(wanted: Wanted) -> tuple[Query, list[Json]]:
    """The query on a scene of the catalogue, and what was left out with reasons; raise with one sentence."""
    planned = plan_study(study_of(wanted), require_scene, is_here)
    return query_of(wanted, [replace(one, camera=wanted.camera) for one in planned.requests]), planned.refused


def query_of(wanted: Wanted, requests: list[Any]) -> Query:
    """The query over planned requests; raise RequestError."""
    return make_query(requests, error=wanted.error, memory=wanted.memory, rounds=wanted.rounds, seed=wanted.seed)


def job_request(query: Query, refused: list[Json]) -> Json:
    """The request of the job: that of its first variant, and what is asked."""
    return query.requests[0].to_json() | {ASKED: {"query": query.to_json(), "refused": refused}}


def asked_of(request: Json) -> Json | None:
    """The query of a job's request, as JSON; None for a job that is no recommendation."""
    asked = request.get(ASKED)
    return None if asked is None else asked["query"]


def found_of(job: Job) -> Json | None:
    """The recommendation that a job came to; None before that."""
    return job.slices[0].measurement if job.state == "done" and job.slices else None
