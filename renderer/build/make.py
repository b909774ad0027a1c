"""Trees built anew; importing this takes the compiler, so only what builds does."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache

import numpy as np

from renderer.build.bvh import build_bvh
from renderer.build.cache import Kind
from renderer.build.epo import epo
from renderer.build.kd import build_kd
from renderer.build.kd_clip import shapes_of
from renderer.build.pad import padded
from renderer.build.progress import Told, untold
from renderer.build.refined import REFINEMENTS, build_refined
from renderer.build.tree import Builder, Bvh, Floats, SahCosts, Tree
from renderer.jit import jit


def timed_build(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts, told: Told) -> tuple[Tree, float]:
    """The structure with its overlap, and the CPU milliseconds of its build without compilation; tells its progress."""
    compile_builder(kind, builder)
    start = time.process_time()
    tree = build_uncached(triangles, kind, builder, costs, told)
    taken = (time.process_time() - start) * 1000.0
    # Whatever cell of a KD-tree holds a point lists its triangle.
    overlap = epo(tree, triangles, costs) if isinstance(tree, Bvh) else 0.0
    return replace(tree, epo=overlap), taken


def build_uncached(triangles: Floats, kind: Kind, builder: Builder, costs: SahCosts, told: Told = untold) -> Tree:
    """The structure alone, built anew."""
    boxes = bounds(triangles)
    if kind == "kd":
        room = padded(boxes)
        return build_kd(room, costs, shapes=shapes_of(triangles, room) if builder == "clipped" else None, told=told)
    if builder == "sah" or builder == "binned" or builder == "median":
        return build_bvh(boxes, costs, builder, told=told)
    return build_refined(boxes, costs, REFINEMENTS[builder], told=told, triangles=triangles)


@lru_cache
def compile_builder(kind: Kind, builder: Builder = "sah") -> None:
    """Builds a few triangles, so that what is timed next is compiled."""
    few = np.eye(3, dtype=np.float32) + np.arange(8, dtype=np.float32)[:, np.newaxis, np.newaxis]
    build_uncached(few, kind, builder, SahCosts())


def bounds(triangles: Floats) -> Floats:
    """The box of each triangle, (m, 2, 3) float32: lower and upper corner."""
    boxes = np.empty((len(triangles), 2, 3), np.float32)
    _bound(triangles, boxes)
    return boxes


@jit
def _bound(triangles: Floats, boxes: Floats) -> None:
    for i in range(len(triangles)):
        for k in range(3):
            a, b, c = triangles[i, 0, k], triangles[i, 1, k], triangles[i, 2, k]
            boxes[i, 0, k], boxes[i, 1, k] = min(min(a, b), c), max(max(a, b), c)
