"""The one way to a structure: from a scene's triangles to a built tree, through the cache."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np

from renderer.build.cache import Kind, cached
from renderer.build.errors import BuildError as BuildError
from renderer.build.progress import Told, sentences, untold
from renderer.build.tree import Builder, Floats, SahCosts, Tree

BUILDERS: dict[Kind, tuple[Builder, ...]] = {
    "bvh": get_args(Builder),
    "kd": ("sah", "clipped"),
}


def build(
    scene_key: str,
    triangles: Floats | Callable[[], Floats],
    kind: Kind,
    builder: Builder = "sah",
    costs: SahCosts | None = None,
    say: Callable[[str], None] | None = None,
) -> tuple[Tree, float]:
    """The structure over `triangles` (m, 3, 3) float32, and the CPU milliseconds of its build without compilation.

    `scene_key` names the triangles by content (Scene.key); a function that gives them is called where nothing is kept.
    A build that takes seconds tells `say` how far it is. A KD-tree is built over padded boxes. Raises BuildError for no
    triangles, coordinates or costs that are not finite, negative costs, and a builder that does not make that kind.
    """
    costs = costs or SahCosts()
    _check(kind, builder, costs)

    def make() -> tuple[Tree, float]:
        given = triangles() if callable(triangles) else triangles
        _check_triangles(given)
        what = f"building a {_NAMES[kind]} ({builder}) over {len(given):,} triangles"
        return _timed_build(given, kind, builder, costs, untold if say is None else sentences(what, say))

    return cached(kind, scene_key, costs, builder, make)


def _timed_build(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts, told: Told) -> tuple[Tree, float]:
    # A tree from the cache needs no builder, and so no compiler.
    from renderer.build.make import timed_build

    return timed_build(triangles, kind, builder, costs, told)


_NAMES: dict[Kind, str] = {"bvh": "BVH", "kd": "KD-tree"}


def _check(kind: Kind, builder: Builder, costs: SahCosts) -> None:
    if builder not in BUILDERS[kind]:
        made = ", ".join(BUILDERS[kind])
        raise BuildError(f"{builder} does not build a {_NAMES[kind]}; take one of {made}.")
    for name, cost in (("traversal", costs.traversal), ("intersection", costs.intersection)):
        if not (math.isfinite(cost) and cost >= 0.0):
            raise BuildError(f"The {name} cost is {cost}; give a finite number that is not negative.")


def _check_triangles(triangles: Floats) -> None:
    if len(triangles) == 0:
        raise BuildError("There are no triangles to build over; give a scene that has some.")
    if not np.isfinite(triangles).all():
        raise BuildError("Some coordinates are not finite numbers; repair the mesh first.")
