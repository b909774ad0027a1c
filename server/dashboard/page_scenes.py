"""The scenes: the catalogue's, each by itself, and those that were measured under another name."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote, urlencode

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.variant import AXES
from scenes.catalogue import ENTRIES, find, is_here
from scenes.entry import Entry
from scenes.scene import SceneError
from server.api.state import database_of
from server.comparison.selection import known_values
from server.dashboard.templates import render
from server.pictures.jobs import Pictured, list_pictured
from server.problems import Problem
from server.scene_list import MAX_TRIANGLES
from server.store.models import Result

router = APIRouter(include_in_schema=False)

RECENT = 200
"""How many of a scene's newest results are looked through for a picture."""
MOST = 300
"""The most names beside the catalogue's that are listed."""


@router.get("/scenes")
def scenes_page(request: Request) -> Response:
    """Every scene of the catalogue, and what else was measured."""
    database = database_of(request)
    others = [name for name in known_values(database)["scene"] if name not in ENTRIES]
    with database.reading() as session:
        scenes = [_view(entry) | {"picture": _newest(session, entry.name)} for entry in ENTRIES.values()]
    context = {
        "scenes": scenes,
        "others": [(name, _address(name)) for name in others[:MOST]],
        "more": len(others) - MOST,
    }
    return render(request, "scenes.html", context)


@router.get("/scenes/{name:path}")
def scene_page(name: str, request: Request) -> Response:
    """One scene; a name that is not the catalogue's is shown when something was measured under it."""
    entry, reason = _entry(name)
    database = database_of(request)
    known = known_values(database)
    with database.reading() as session:
        measured = session.scalar(select(Result.id).where(Result.scene == name).limit(1)) is not None
        picture = _newest(session, name)
    if entry is None and not measured:
        raise Problem(404, reason)
    context = {
        "name": name,
        "scene": None if entry is None else _view(entry) | _geometry(entry),
        "reason": reason,
        "measured": measured,
        "picture": picture,
        "results": f"/?{urlencode({'scene': name, 'cols': 'device'})}",
        "against_error": f"/?{urlencode({'scene': name, 'rows': ','.join(_varied(known)), 'chart': 'error'})}",
        "pictures": f"/pictures?{urlencode({'scene': name})}",
        "submit": f"/submit?{urlencode({'scenes': name})}",
    }
    return render(request, "scene.html", context)


def _varied(known: dict[str, list[str]]) -> list[str]:
    """The axes that tell stored variants apart."""
    return ["traversal", *(axis for axis in AXES if axis != "traversal" and len(known.get(axis, ())) > 1)]


def _entry(name: str) -> tuple[Entry | None, str]:
    """The catalogue's entry, a sized one among them; else why there is none."""
    try:
        return find(name), ""
    except SceneError as error:
        return None, str(error)


def _newest(session: Session, name: str) -> Pictured | None:
    return next(iter(list_pictured(session, scene=name, looked_at=RECENT)), None)


def _view(entry: Entry) -> dict[str, Any]:
    here = is_here(entry)
    return {
        "name": entry.name,
        "title": entry.title,
        "triangles": entry.triangles,
        "licence": entry.licence,
        "source": entry.source,
        "page": entry.page,
        "note": entry.note,
        "here": here,
        "how": entry.get,
        "address": _address(entry.name),
        "measurable": here and entry.triangles <= MAX_TRIANGLES,
    }


def _geometry(entry: Entry) -> dict[str, Any]:
    camera = entry.camera
    return {
        "camera": None if camera is None else [("eye", _point(camera.eye)), ("target", _point(camera.target)),
                                               ("up", _point(camera.up)), ("field of view", f"{camera.fov:g}°")],
        "lights": [_point(light) for light in entry.lights],
        "normals": {"file": "from the file", "smooth": "smoothed", "flat": "flat"}[entry.normals],
    }  # fmt: skip


def _point(point: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"


def _address(name: str) -> str:
    return f"/scenes/{quote(name, safe=':')}"
