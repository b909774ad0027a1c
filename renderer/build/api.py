"""The one way to a structure: from a scene's triangles to a built tree, through the cache."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from renderer.build.bvh import build_bvh
from renderer.build.cache import Kind, cached
from renderer.build.epo import epo
from renderer.build.errors import BuildError as BuildError
from renderer.build.kd import build_kd
from renderer.build.kd_clip import shapes_of
from renderer.build.pad import padded
from renderer.build.refined import REFINEMENTS, build_refined
from renderer.build.tree import Bvh, Floats, SahCosts, Tree
from renderer.jit import jit

Builder = Literal["sah", "binned", "median", "reinserted", "sbvh", "sbvh-reinserted", "clipped"]
"""How a tree is built: a KD-tree by `sah` or `clipped`, a BVH by all but `clipped`."""

BUILDERS: dict[Kind, tuple[Builder, ...]] = {
    "bvh": tuple(builder for builder in get_args(Builder) if builder != "clipped"),
    "kd": ("sah", "clipped"),
}


def build(
    scene_key: str, triangles: Floats, kind: Kind, builder: Builder = "sah", costs: SahCosts | None = None
) -> tuple[Tree, float]:
    """The structure over `triangles` (m, 3, 3) float32, and the CPU milliseconds of its build without compilation.

    `scene_key` names the triangles by content (Scene.key). A KD-tree is built over padded boxes. Raises BuildError for
    no triangles, coordinates or costs that are not finite, negative costs, and a builder that does not make that kind.
    """
    costs = costs or SahCosts()
    _check(triangles, kind, builder, costs)
    return cached(kind, scene_key, costs, builder, lambda: _timed_build(triangles, kind, builder, costs))


def _timed_build(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts) -> tuple[Tree, float]:
    compile_builder(kind, builder)
    start = time.process_time()
    tree = build_uncached(triangles, kind, builder, costs)
    taken = (time.process_time() - start) * 1000.0
    # Whatever cell of a KD-tree holds a point lists its triangle.
    overlap = epo(tree, triangles, costs) if isinstance(tree, Bvh) else 0.0
    return replace(tree, epo=overlap), taken


def build_uncached(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts) -> Tree:
    """The structure alone, built anew."""
    boxes = bounds(triangles)
    if kind == "kd":
        room = padded(boxes)
        return build_kd(room, costs, shapes=shapes_of(triangles, room) if builder == "clipped" else None)
    if builder == "sah" or builder == "binned" or builder == "median":
        return build_bvh(boxes, costs, builder)
    return build_refined(boxes, costs, REFINEMENTS[builder])


_NAMES: dict[Kind, str] = {"bvh": "BVH", "kd": "KD-tree"}


@lru_cache
def compile_builder(kind: Kind, builder: Builder = "sah") -> None:
    """Builds a few triangles, so that what is timed next is compiled."""
    few = np.eye(3, dtype=np.float32) + np.arange(8, dtype=np.float32)[:, np.newaxis, np.newaxis]
    build_uncached(few, kind, builder, SahCosts())


@jit
def bounds(triangles: Floats) -> Floats:
    """The box of each triangle, (m, 2, 3) float32: lower and upper corner."""
    boxes = np.empty((len(triangles), 2, 3), np.float32)
    for i in range(len(triangles)):
        for k in range(3):
            a, b, c = triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k]
            boxes[i, 0, k], boxes[i, 1, k] = min(min(a, b), c), max(max(a, b), c)
    return boxes


def _check(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts) -> None:
    if builder not in BUILDERS[kind]:
        made = ", ".join(BUILDERS[kind])
        raise BuildError(f"{builder} does not build a {_NAMES[kind]}; take one of {made}.")
    if len(triangles) == 0:
        raise BuildError("There are no triangles to build over; give a scene that has some.")
    if not np.isfinite(triangles).all():
        raise BuildError("Some coordinates are not finite numbers; repair the mesh first.")
    for name, cost in (("traversal", costs.traversal), ("intersection", costs.intersection)):
        if not (math.isfinite(cost) and cost >= 0.0):
            raise BuildError(f"The {name} cost is {cost}; give a finite number that is not negative.")
