"""The way of `bench` and `heatmap` from their options to requests, checked before anything runs."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

from renderer.request import Request
from renderer.variant import Variant
from renderer.view import view_of
from scenes.load import load
from scenes.scene import Camera, Point, Scene
from server.cli.options import OptionError
from server.studies import BRUTE_FORCE_LIMIT, Planned, Study, plan_study
from server.study_axes import read_costs, read_switch

__all__ = ["Here", "plan_here", "print_refused", "read_camera", "read_costs", "read_switch", "slow_warning"]

TEST_S = 25e-9
"""About the seconds of one ray-triangle test of brute force on one core of llvmpipe."""

FARTHEST = 1e9
"""The largest coordinate of a camera, as the API has it."""


@dataclass(frozen=True, eq=False)
class Here:
    """What is to run here: the scene as loaded, at least one request, and what was left out with reasons."""

    scene: Scene
    requests: list[Request]
    refused: list[tuple[Variant, str]]


def plan_here(study: Study, camera: Camera | None = None, threads: int = 1) -> Here:
    """Turn a study of one scene into requests; raise with one sentence when the scene or a value is no good."""
    (name,) = study.scenes
    _plan(study, name, None)  # A misspelt value is told before a large scene is read.
    scene = load(name, camera=camera)
    view_of(scene, scene.camera, study.size)
    planned = _plan(study, name, len(scene.faces))
    requests = [replace(request, camera=camera, threads=threads) for request in planned.requests]
    return Here(scene, requests, [_refused(entry) for entry in planned.refused])


def slow_warning(here: Here, frames: int) -> str | None:
    """How long `frames` of brute force take where it was asked for by name above the limit of `all`; else None."""
    tests, traversal = max((_tests_of_frame(one, here.scene), one.variant.traversal) for one in here.requests)
    if tests <= BRUTE_FORCE_LIMIT:
        return None
    seconds = tests * TEST_S
    return (
        f"{traversal} makes up to {tests:.1e} ray-triangle tests a frame here: about {seconds:,.0f} s a frame, "
        f"{seconds * frames:,.0f} s in all."
    )


def print_refused(here: Here, as_json: bool) -> None:
    """List on standard error what was left out: a line of JSON for each, or a line for each reason."""
    if as_json:
        for variant, reason in here.refused:
            print(json.dumps({"refused": variant.as_dict(), "reason": reason}), file=sys.stderr)
        return
    labels: dict[str, list[str]] = {}
    for variant, reason in here.refused:
        labels.setdefault(reason, []).append(variant.label)
    for reason, variants in labels.items():
        print(f"Left out {', '.join(variants)}: {reason}", file=sys.stderr)


def read_camera(texts: tuple[str, str, str] | None) -> Camera | None:
    """Read EYE, TARGET and FOV; None for None."""
    if texts is None:
        return None
    fov = _numbers(texts[2], 1)
    if fov is None:
        raise OptionError(f"The field of view {texts[2]!r} is not understood: write degrees, as 60.")
    return Camera(_point("eye", texts[0]), _point("target", texts[1]), fov[0])


def _plan(study: Study, name: str, triangles: int | None) -> Planned:
    return plan_study(study, lambda _: {"name": name, "triangles": triangles}, lambda _: True)


def _refused(entry: Mapping[str, str]) -> tuple[Variant, str]:
    return Variant(**{axis: entry[axis] for axis in Variant().as_dict()}), entry["reason"]


def _tests_of_frame(request: Request, scene: Scene) -> int:
    """Ray-triangle tests of one frame of brute force, at most; 0 for a request that walks a structure."""
    if request.variant.structure != "none":
        return 0
    width, height = request.size
    return width * height * len(scene.faces) * (2 if request.rays == "both" else 1)


def _point(name: str, text: str) -> Point:
    values = _numbers(text, 3)
    if values is None or not all(abs(value) <= FARTHEST for value in values):
        raise OptionError(f"The camera's {name} {text!r} is not understood: write it as 1.0,2.0,3.0.")
    x, y, z = values
    return x, y, z


def _numbers(text: str, count: int) -> list[float] | None:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return values if len(values) == count else None
