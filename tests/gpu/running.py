"""Runs plans in this process, on one context for the whole session."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest

from renderer.build.api import build
from renderer.build.tree import Builder, Bvh, SahCosts, Tree
from renderer.pack.api import pack
from renderer.plan import Plan
from renderer.prepare import Prepared
from renderer.readback import read_records
from renderer.records import Records
from renderer.request import Request
from renderer.twin import Twin, open_context
from renderer.variant import TRAVERSALS, Variant
from scenes import catalogue
from scenes.load import load
from scenes.scene import Scene

Image = npt.NDArray[np.uint8]

WALKS = tuple(name for name, row in TRAVERSALS.items() if row.structure != "none" and not row.packet)
"""The traversals that walk a structure ray by ray; each is compared with brute force."""

PACKETS = tuple(name for name, row in TRAVERSALS.items() if row.packet)
"""Those that trace several pixels an invocation, which `compute` alone does."""


@cache
def context() -> Any:
    """The session's one context."""
    return open_context()


@cache
def catalogue_scene(name: str) -> Scene:
    """A scene of the catalogue; a test that needs one whose files are not here is skipped."""
    if not catalogue.is_here(catalogue.find(name)):
        pytest.skip(f"{name} is not in the folders of RAYFARM_SCENES")
    return load(name)


@dataclass(frozen=True, eq=False)
class Run:
    """What one instrumented plan gave: its records and its image, and the plan itself."""

    plan: Plan
    records: Records
    image: Image


def prepared(scene: Scene, variant: Variant, size: tuple[int, int], **options: Any) -> Prepared:
    """A request on a scene that need not be in the catalogue, made ready; `options` are those of Request."""
    request = Request(scene.name, variant, size, **options)
    tree = None
    if variant.structure != "none":
        builder = cast(Builder, variant.builder)
        tree = tree_of(scene, variant.structure, builder, request.costs)
    return Prepared(request, scene, tree, None, pack(scene, tree, request))


@lru_cache(maxsize=6)
def tree_of(scene: Scene, kind: Any, builder: Builder = "sah", costs: SahCosts | None = None) -> Tree:
    """The scene's tree; hand-made scenes leave nothing in the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        if not scene.source:
            patch.setenv("RAYFARM_CACHE", _folder().name)
        return build(scene.key, scene.triangles, kind, builder, costs)[0]


def bvh_of(scene: Scene) -> Bvh:
    """The BVH that the referee walks."""
    tree = tree_of(scene, "bvh")
    assert isinstance(tree, Bvh)
    return tree


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="rayfarm-trees-")


def run(scene: Scene, variant: Variant, size: tuple[int, int], **options: Any) -> Run:
    """Run the instrumented plan once."""
    plan = prepared(scene, variant, size, **options).plan(instrument=True)
    return run_plan(plan, len(scene.lights), rasterised=variant.method == "hybrid")


def run_plan(plan: Plan, lights: int, *, rasterised: bool = False) -> Run:
    """Run an instrumented plan of a scene with that many lights once."""
    with ready(plan) as twin:
        records = read_records(plan.size, plan.tile, lights, twin.collect(), rasterised=rasterised)
        return Run(plan, records, twin.image())


def picture(plan: Plan) -> Image:
    """The image of one frame."""
    with ready(plan) as twin:
        twin.frame()
        return twin.image()


@contextmanager
def ready(plan: Plan) -> Iterator[Twin]:
    """A twin whose setup passes have run; the device's memory is given back at the end."""
    twin = Twin(context(), plan)
    try:
        twin.setup()
        yield twin
    finally:
        twin.release()
