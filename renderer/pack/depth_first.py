"""A BVH's nodes in the order in which a ray that enters every box visits them: what skip links are made of."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh
from renderer.jit import jit

Ints = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]
Words = npt.NDArray[np.uint32]
Flags = npt.NDArray[np.bool_]

OCTANTS = 8


def depth_first(tree: Bvh, tested: Flags, octant: int) -> tuple[Ints, Ints]:
    """Each node's place among those that are `tested`, and the place that follows its subtree, (n,) int32 all.

    Bit k of `octant` says that rays run backward along axis k: children split along it are visited the right one first.
    What comes first in a node, and what follows a leaf, is at its place + 1; a node that is not tested has the place of
    what comes first in it.
    """
    return _places(tree.child, tree.count, tree.axis, tested, octant)


def lay_out(
    rows: Words,
    tree: Bvh,
    tested: Flags,
    octant: int,
    faces: tuple[int, int],
    skip: tuple[int, int],
    base: int,
    out: Words,
) -> None:
    """Put the rows (n, words) of tested nodes into `out`, in the order of `depth_first`, near faces for lower ones.

    `faces` are the words where lower and upper faces begin, one and the same where they are a word's low and high
    halves. `skip` is the word of an inner node, and its first bit there, that gets the place behind its subtree,
    counted from `base`.
    """
    place, after = depth_first(tree, tested, octant)
    _lay_out(rows, tree.count, tested, place, after, octant, faces, skip, base, out)


@jit
def _lay_out(
    rows: Words,
    count: Ints,
    tested: Flags,
    place: Ints,
    after: Ints,
    octant: int,
    faces: tuple[int, int],
    skip: tuple[int, int],
    base: int,
    out: Words,
) -> None:
    half = np.uint32(16)
    for node in range(len(rows)):
        if not tested[node]:
            continue
        row = out[place[node]]
        row[:] = rows[node]
        for axis in range(3):
            low, high = faces[0] + axis, faces[1] + axis
            if octant >> axis & 1 and low == high:
                row[low] = row[low] << half | row[low] >> half
            elif octant >> axis & 1:
                row[low], row[high] = row[high], row[low]
        if count[node] == 0:
            row[skip[0]] |= np.uint32(base + after[node]) << np.uint32(skip[1])


@jit
def _places(child: Ints, count: Ints, axis: Bytes, tested: Flags, octant: int) -> tuple[Ints, Ints]:
    size, place = tested.astype(np.int32), np.zeros(len(child), np.int32)
    for node in range(len(child) - 1, -1, -1):
        if count[node] == 0:
            size[node] += size[child[node]] + size[child[node] + 1]
    for node in range(len(child)):
        if count[node] == 0:
            right_first = (octant >> axis[node]) & 1
            near, far = child[node] + right_first, child[node] + 1 - right_first
            place[near] = place[node] + tested[node]
            place[far] = place[near] + size[near]
    return place, place + size
