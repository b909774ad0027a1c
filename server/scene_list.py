"""The scenes that the service offers: the catalogue's, by name only, never a path of the server's disk."""

from __future__ import annotations

from typing import Any

from scenes import catalogue
from scenes.catalogue import list_scenes
from scenes.entry import Entry
from scenes.scene import SceneError

__all__ = ["is_here", "list_scenes", "require_scene"]

MAX_TRIANGLES = 5_000_000


def require_scene(name: str) -> dict[str, Any]:
    """Name and triangles of a scene that can be measured here; raise SceneError with one sentence otherwise."""
    entry = _find(name)
    if not catalogue.is_here(entry):
        raise SceneError(f"The scene {name} is not on this server: {entry.get}.")
    if entry.triangles > MAX_TRIANGLES:
        raise SceneError(f"{name} has more than {MAX_TRIANGLES} triangles: ask for fewer.")
    return {"name": entry.name, "triangles": entry.triangles}


def is_here(name: str) -> bool:
    """Whether a scene of the catalogue can be measured here."""
    return catalogue.is_here(_find(name))


def _find(name: str) -> Entry:
    if name.partition(":")[0] not in catalogue.ENTRIES:
        raise SceneError(f"Unknown scene {name[:80]!r}: choose one of {', '.join(catalogue.ENTRIES)}.")
    return catalogue.find(name)
