"""BVHs for walks along links, without the boxes whose test saves less than it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from renderer.build.merging import price, ranges, shares, shares_in_place
from renderer.build.refit import half_areas
from renderer.build.tree import Bvh, Bytes, Ints
from renderer.jit import jit

Flags = npt.NDArray[np.bool_]

MOST = 4
"""Leaves are merged up to so many triangles."""


def pruned(tree: Bvh, width: int, triangle: float, spread: float) -> tuple[Bvh, Flags]:
    """The tree with small leaves merged, and which of its nodes to test, (n,); what lies below a merged leaf is not.

    A walk along links needs no parents: where a box is not tested, it comes to those below as if the box were entered.
    So a box is tested only where that saves tests of boxes below and of triangles, one of which counts `triangle` of
    them. What is tested next of a tested node is at most `width` boxes (2 to 8): with 2, leaves alone are merged. How
    often rays enter a box goes with its surface, grown by how far apart they are: by `spread` sides of a cube that has
    the median leaf's surface.
    """
    size = tree.upper.astype(np.float64) - tree.lower
    leaves = half_areas(size[tree.count > 0])
    weight = half_areas(size + spread * np.sqrt(np.median(leaves) / 3.0))
    if weight[0] == 0.0:
        weight = np.ones_like(weight)
    sizes, firsts = ranges(tree.child, tree.count)
    _, choice = price(weight, tree.child, tree.count, sizes, width, MOST, 0.0, 1.0, triangle)
    child, count = tree.child.copy(), tree.count.copy()
    tested = _keep(choice, sizes, firsts, child, count)
    return replace(tree, child=child, count=count), tested


@jit
def _keep(choice: Bytes, sizes: Ints, firsts: Ints, child: Ints, count: Ints) -> Flags:
    """Which nodes are kept; `child` and `count` of merged leaves are set."""
    kept, trees = np.zeros(len(child), np.bool_), np.zeros(len(child), np.int32)
    trees[0] = 1
    for node in range(len(child)):
        if trees[node] == 0:
            continue
        left, right = shares_in_place(choice, node, trees[node])
        kept[node] = left == 0
        if kept[node] and choice[node, 0] == 0:
            child[node], count[node] = firsts[node], sizes[node]
            continue
        if kept[node]:
            left, right = shares(choice, node)
        trees[child[node]], trees[child[node] + 1] = left, right
    return kept
