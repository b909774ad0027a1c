"""Recommendations: a form for one, the latest ones, and one with what was given up for it."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from renderer.recommend.halving import ROUNDS
from renderer.recommend.query import ERROR_BUDGET
from renderer.request import RAYS
from renderer.variant import AXES, TRAVERSALS
from server.api.recommendations import find_recommendation, latest, recommendation_line, recommendation_view
from server.api.state import database_of
from server.considered import considered
from server.dashboard.page_submit import known_devices
from server.dashboard.templates import render
from server.dashboard.waiting import wait_of
from server.scene_list import list_scenes
from server.store.states import OPEN

router = APIRouter(include_in_schema=False)
SHOWN = 25
Json = dict[str, Any]


@router.get("/recommend")
def recommend_page(request: Request) -> Response:
    """A form, and the latest recommendations."""
    with database_of(request).reading() as session:
        context = {
            "devices": known_devices(session),
            "recommendations": [recommendation_line(job) for job in latest(session, SHOWN)],
        }
    ticked = {axis: _ticked(axis, value) for axis, value in considered().items()}
    scenes = [scene for scene in list_scenes() if scene["here"]]
    asked = {"scene": request.query_params.get("scene", ""), "error": ERROR_BUDGET, "rounds": ROUNDS}
    return render(
        request,
        "recommend.html",
        {**context, "axes": AXES, "ticked": ticked, "scenes": scenes, "rays": RAYS, "asked": asked},
    )


@router.get("/recommend/{job_id}")
def recommendation_page(job_id: str, request: Request) -> Response:
    """One recommendation: how far it is, or what it came to."""
    with database_of(request).reading() as session:
        job = find_recommendation(session, job_id)
        one = recommendation_view(job)
        context = {
            "one": one,
            "found": _found(one["recommendation"]),
            "after": max((change.id for change in job.changes), default=0),
            "open_states": OPEN,
            "wait": wait_of(session, job, request.app.state.lease_s),
        }
    return render(request, "recommendation.html", context)


def _ticked(axis: str, usual: str) -> tuple[str, ...]:
    """What is ticked of an axis: of `all` what walks a structure, as what is ticked is asked for by name."""
    values = AXES[axis] if usual == "all" else (usual,)
    return tuple(value for value in values if axis != "traversal" or TRAVERSALS[value].structure != "none")


def _found(document: Json | None) -> Json | None:
    """The document with what was eliminated in the order of interest: the latest rung first, then the ratio."""
    if document is None:
        return None
    gone = sorted(document["eliminated"], key=lambda one: (-one["size"][0] * one["size"][1], one["ratio"]))
    left_out = [
        (one["label"], f"wrong on {one['wrong']:.1e} of {one['rays']:,} rays") for one in document["over_error"]
    ]
    left_out += [(one["label"], f"{one['memory_bytes'] / 1e6:.1f} MB") for one in document["over_memory"]]
    left_out += [(one["label"], f"could not run: {one['reason']}") for one in document["unable"]]
    left_out += [(one["label"], f"the same program and data as {one['as']}") for one in document["same"]]
    return document | {"slower": [*document["unconfirmed"], *gone], "left_out": left_out}
