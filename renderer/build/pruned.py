"""BVHs for walks along links, without the boxes whose test saves less than it costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from renderer.build.levels import first_slots, inner_levels, summed
from renderer.build.merging import FEWER, SHARE, price
from renderer.build.tree import Bvh, Bytes, Ints, half_areas

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
    levels = inner_levels(tree.child, tree.count)
    sizes = summed(tree.count, tree.child, levels)
    _, choice = price(weight, tree.child, sizes, levels, width, MOST, 0.0, 1.0, triangle)
    tested, merged = _chosen(choice, tree.child, levels)
    child = np.where(merged, first_slots(tree.child, levels), tree.child)
    return replace(tree, child=child, count=np.where(merged, sizes, tree.count)), tested


def _chosen(choice: Bytes, child: Ints, levels: list[Ints]) -> tuple[Flags, Flags]:
    """Which nodes are kept, and which inner ones become leaves."""
    trees, opened, merged = np.zeros(len(child), np.uint8), np.zeros(len(child), bool), np.zeros(len(child), bool)
    trees[0] = 1
    for level in levels:
        inner = level[trees[level] > 0]
        most = trees[inner]
        for j in range(choice.shape[1] - 1, 0, -1):
            most -= (most == j + 1) & (choice[inner, j] >= FEWER)
        total = np.where(most > 1, most, choice[inner, 0])
        opened[inner], merged[inner] = most > 1, total == 0
        inner, total = inner[total > 0], total[total > 0]
        left = choice[inner, total - 1] & SHARE
        trees[child[inner]], trees[child[inner] + 1] = left, total - left
    return (trees > 0) & ~opened, merged
