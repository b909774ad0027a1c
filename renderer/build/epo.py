"""End-point overlap: visits that a ray owes to nodes that hold its end, but not what it hits (Aila et al. 2013).

The EPO of a tree is the mean over the scene's surface of what it costs to visit every node whose box holds a point
there while the point's triangle is not below it. So it is estimated at random points, uniform on the surface and always
the same for the same triangles.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh, Floats, Ints, SahCosts
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

SEED = 20130719
POINTS = 1 << 14
"""Points of one batch."""

MOST = 64
"""Batches at most."""

ERROR = 0.01
"""The standard error at which no more batches are drawn, relative to the EPO."""


def epo(tree: Bvh, triangles: Floats, costs: SahCosts) -> float:
    """The EPO of a BVH over `triangles` (m, 3, 3) float32, with a standard error of 1 % unless MOST batches gave more.

    0 where nothing has an area. A KD-tree has none by construction: whatever cell holds a point lists its triangle.
    """
    area = _areas(triangles)
    if not area.sum() > 0.0:
        return 0.0
    upto = np.cumsum(area / area.max())
    leaves, first = _leaves_of(tree, len(triangles))
    rng = np.random.default_rng(SEED)
    total, squares, n = 0.0, 0.0, 0
    for _ in range(MOST):
        chosen = np.searchsorted(upto, rng.random(POINTS) * upto[-1], side="right").clip(max=len(area) - 1)
        points = _points(triangles, chosen, rng.random((POINTS, 2)))
        found = _overlaps(
            tree.lower,
            tree.upper,
            tree.child,
            tree.count,
            tree.parent,
            points,
            chosen,
            leaves,
            first,
            costs.traversal,
            costs.intersection,
        )
        total, squares, n = total + float(found.sum()), squares + float((found**2).sum()), n + POINTS
        mean = total / n
        if (squares / n - mean * mean) / n <= (ERROR * mean) ** 2:
            break
    return total / n


def _areas(triangles: Floats) -> Doubles:
    corners = triangles.astype(np.float64)
    area: Doubles = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return area


def _points(triangles: Floats, chosen: npt.NDArray[np.int64], share: Doubles) -> Doubles:
    """A uniform point of each chosen triangle, (n, 3); rounding takes none out of its triangle's box."""
    corners = triangles[chosen].astype(np.float64)
    root = np.sqrt(share[:, :1])
    point = corners[:, 0] * (1.0 - root) + root * (corners[:, 1] * (1.0 - share[:, 1:]) + corners[:, 2] * share[:, 1:])
    inside: Doubles = np.clip(point, corners.min(axis=1), corners.max(axis=1))
    return inside


def _leaves_of(tree: Bvh, triangles: int) -> tuple[Ints, npt.NDArray[np.int64]]:
    """The leaves that hold each triangle, one triangle's after another's, and where each triangle's begin."""
    leaf = np.flatnonzero(tree.count > 0)
    of_slot = np.empty(len(tree.order), np.int32)
    of_slot[_ranges(tree.child[leaf], tree.count[leaf])] = np.repeat(leaf, tree.count[leaf])
    by_triangle = np.argsort(tree.order, kind="stable")
    first = np.searchsorted(tree.order[by_triangle], np.arange(triangles + 1))
    return of_slot[by_triangle], first


def _ranges(first: Ints, count: Ints) -> npt.NDArray[np.int64]:
    """All slots of all ranges, one range after another."""
    starts = np.cumsum(count) - count
    slots: npt.NDArray[np.int64] = np.arange(count.sum()) + np.repeat(first.astype(np.int64) - starts, count)
    return slots


@jit
def _overlaps(
    lower: Floats,
    upper: Floats,
    child: Ints,
    count: Ints,
    parent: Ints,
    points: Doubles,
    chosen: npt.NDArray[np.int64],
    leaves: Ints,
    first: npt.NDArray[np.int64],
    traversal: float,
    intersection: float,
) -> Doubles:
    """What the nodes cost that hold each point (n, 3) but not its triangle."""
    found, marked = np.zeros(len(points), np.float64), np.full(len(child), -1, np.int64)
    stack = np.empty(len(child) + 1, np.int32)
    for i in range(len(points)):
        for k in range(first[chosen[i]], first[chosen[i] + 1]):
            node = leaves[k]
            while node >= 0 and marked[node] != i:
                marked[node] = i
                node = parent[node]
        stack[0], top = 0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if not _holds(lower, upper, node, points, i):
                continue
            if marked[node] != i:
                found[i] += intersection * count[node] if count[node] > 0 else traversal
            if count[node] == 0:
                stack[top], stack[top + 1] = child[node] + 1, child[node]
                top += 2
    return found


@jit
def _holds(lower: Floats, upper: Floats, node: int, points: Doubles, i: int) -> bool:
    inside = True
    for k in range(3):
        inside = inside and lower[node, k] <= points[i, k] <= upper[node, k]
    return inside
