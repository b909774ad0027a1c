"""Rendered images and heatmaps: two jobs laid over each other, side by side, their difference, or a whole scene's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.pictures.files import PictureError
from server.api.profiles import blobs_of
from server.api.state import database_of
from server.api.views import find_study
from server.dashboard.templates import render
from server.pictures.choice import MOST, VIEWS, Choice, choose, read_asked
from server.pictures.colours import Stop, change_stops, heat_stops
from server.pictures.drawn import compare_pictures, figures_of, scale_of
from server.pictures.jobs import WHATS, Pictured
from server.problems import Problem
from server.store.blobs import BlobError, Blobs
from server.store.models import Study

router = APIRouter(include_in_schema=False)
SHOWN = 50
SMALL = 600
"""Pictures of fewer pixels across are drawn with sharp ones."""


@dataclass(frozen=True)
class Control:
    """A list to choose from: its title, its name, (value, text) of every option, the chosen value."""

    title: str
    name: str
    options: list[tuple[str, str]]
    chosen: str


@dataclass(frozen=True)
class Scale:
    """A legend: its colours, its top, its numbers from left to right, what they count, what else to know."""

    stops: list[Stop]
    top_value: int
    numbers: list[str]
    label: str
    note: str


@router.get("/pictures")
def pictures_page(request: Request) -> Response:
    """Pictures; the query string is their whole state."""
    asked = read_asked(request.query_params)
    with database_of(request).reading() as session:
        choice = choose(session, asked)
        studies = _studies(session, asked.study)
    context: dict[str, Any] = {
        "choice": choice,
        "asked": asked,
        "controls": _controls(choice, studies),
        "small": SMALL,
        "compared": None,
        "shown": [],
        "scale": None,
        "notes": [choice.note] if choice.note else [],
    }
    return render(request, "pictures.html", context | _told(blobs_of(request), choice, context["notes"]))


def _studies(session: Session, chosen: int | None) -> list[tuple[str, str]]:
    """The newest studies and the chosen one."""
    newest = select(Study.id, Study.name).order_by(Study.id.desc()).limit(SHOWN)
    studies = {row.id: row.name for row in session.execute(newest)}
    if chosen is not None and chosen not in studies:
        studies[chosen] = find_study(session, str(chosen)).name
    return [(str(number), f"{number}: {name}") for number, name in studies.items()]


def _controls(choice: Choice, studies: list[tuple[str, str]]) -> list[Control]:
    asked = choice.asked
    jobs = [(str(job.job), job.title) for job in choice.jobs]
    chosen = [str(job.job) if job else "" for job in (choice.baseline, choice.against)]
    pair = [Control("Baseline", "baseline", jobs, chosen[0]), Control("Against", "against", jobs, chosen[1])]
    return [
        Control("Scene", "scene", [(scene, scene) for scene in choice.scenes], choice.scene or ""),
        Control("Study", "study", [("", "any"), *studies], str(asked.study or "")),
        *([] if asked.view == "all" else pair),
        Control("What", "what", list(WHATS.items()), asked.what),
        Control("View", "view", list(VIEWS.items()), asked.view),
    ]


def _told(blobs: Blobs, choice: Choice, notes: list[str]) -> dict[str, Any]:
    """What needs the stored pictures themselves; where they cannot be read, a note says why."""
    try:
        if choice.asked.view == "all":
            return _all(blobs, choice, notes)
        if choice.baseline is not None and choice.against is not None:
            return _two(blobs, choice, choice.baseline, choice.against, notes)
    except (BlobError, PictureError, Problem) as error:
        notes.append(str(error.detail) if isinstance(error, Problem) else str(error))
    return {}


def _two(blobs: Blobs, choice: Choice, baseline: Pictured, against: Pictured, notes: list[str]) -> dict[str, Any]:
    if baseline.scene != against.scene:
        notes.append("The two jobs show different scenes.")
    compared = compare_pictures(blobs, baseline, against, choice.asked.what)
    scale = _change_scale(compared) if choice.asked.view == "difference" else _heat_scale(compared["scale"])
    return {"compared": compared, "scale": scale}


def _all(blobs: Blobs, choice: Choice, notes: list[str]) -> dict[str, Any]:
    what, found = choice.asked.what, choice.all_of_scene
    shown = found[:MOST]
    if len(shown) < len(found):
        notes.append(f"{len(found)} variants have pictures: the first {MOST} are shown. Choose a study to see fewer.")
    if not shown:
        return {}
    scale = _heat_scale(scale_of(blobs, what, shown))
    return {"shown": [(job, figures_of(blobs, job, what)) for job in shown], "scale": scale}


def _heat_scale(scale: dict[str, Any] | None) -> Scale | None:
    if scale is None:
        return None
    top = scale["top"]
    note = f"Light blue: above {top:,}." if scale["above"] else ""
    return Scale(heat_stops(), top, [f"{top * part / 4:,g}" for part in range(5)], scale["label"], note)


def _change_scale(compared: dict[str, Any]) -> Scale | None:
    change, top = compared["difference"], compared["difference"]["top"]
    if top is None:
        return None
    numbers = [f"−{top:,}", "0", f"+{top:,}"]
    note = "Some pixels are beyond the scale and have the colours of its ends." if change["beyond"] else ""
    label = f"{compared['label']} per pixel, job {compared['against']['job']} minus job {compared['baseline']['job']}"
    return Scale(change_stops(), top, numbers, label, note)
