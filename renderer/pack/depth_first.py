"""A BVH's nodes in the order in which a ray that enters every box visits them: what skip links are made of."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh
from renderer.jit import jit

Ints = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]

OCTANTS = 8


def depth_first(tree: Bvh, octant: int) -> tuple[Ints, Ints]:
    """Each node's place among n, and the place that follows its subtree, (n,) int32 both.

    Bit k of `octant` says that rays run backward along axis k: children split along it are visited the right one first.
    A node's first child, and what follows a leaf, is at its place + 1.
    """
    return _places(tree.child, tree.count, tree.axis, octant)


@jit
def _places(child: Ints, count: Ints, axis: Bytes, octant: int) -> tuple[Ints, Ints]:
    size, place = np.ones(len(child), np.int32), np.zeros(len(child), np.int32)
    for node in range(len(child) - 1, -1, -1):
        if count[node] == 0:
            size[node] += size[child[node]] + size[child[node] + 1]
    for node in range(len(child)):
        if count[node] == 0:
            right_first = (octant >> axis[node]) & 1
            near, far = child[node] + right_first, child[node] + 1 - right_first
            place[near] = place[node] + 1
            place[far] = place[near] + size[near]
    return place, place + size
