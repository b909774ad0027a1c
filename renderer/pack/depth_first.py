"""A BVH's nodes in the order in which a ray that enters every box visits them: what skip links are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.build.levels import inner_levels, summed
from renderer.build.tree import Bvh, Ints

Words = npt.NDArray[np.uint32]
Flags = npt.NDArray[np.bool_]

OCTANTS = 8


@dataclass(frozen=True, eq=False)
class DepthFirst:
    """A tree, which of its nodes are `tested` (n,), and what is the same in all their orders.

    `levels` are the inner nodes, `sizes` (n,) how many nodes of each subtree are tested.
    """

    tree: Bvh
    tested: Flags
    levels: list[Ints]
    sizes: Ints


def depth_first(tree: Bvh, tested: Flags) -> DepthFirst:
    """The tested nodes of a tree, to be put in order."""
    levels = inner_levels(tree.child, tree.count)
    return DepthFirst(tree, tested, levels, summed(tested.astype(np.int32), tree.child, levels))


def places(nodes: DepthFirst, octant: int) -> Ints:
    """Each node's place (n,) among those that are tested; its subtree's end at its place + its size.

    Bit k of `octant` says that rays run backward along axis k: children split along it are visited the right one first.
    What comes first in a node, and what follows a leaf, is at its place + 1; a node that is not tested has the place of
    what comes first in it.
    """
    tree, sizes = nodes.tree, nodes.sizes
    place = np.zeros(len(sizes), np.int32)
    for inner in nodes.levels:
        left, inside = tree.child[inner], place[inner] + nodes.tested[inner]
        backward = octant >> tree.axis[inner] & 1
        place[left] = inside + backward * sizes[left + 1]
        place[left + 1] = inside + (1 - backward) * sizes[left]
    return place


def lay_out(
    nodes: DepthFirst, rows: Words, octant: int, faces: tuple[int, int], skip: tuple[int, int], base: int, out: Words
) -> None:
    """Put the tested nodes' rows (m, words) into `out` (m + 1, words) by their places, near faces for lower ones.

    `faces` are the words where lower and upper faces begin, one and the same where they are a word's low and high
    halves. `skip` is the word of an inner node, and its first bit there, that gets the place behind its subtree,
    counted from `base`.
    """
    place, half = places(nodes, octant), np.uint32(16)
    order = np.empty(len(rows), np.int32)
    order[place[nodes.tested]] = np.arange(len(rows), dtype=np.int32)
    # Unlike an assignment by index this runs without Python's lock.
    np.take(rows, order, axis=0, out=out[:-1], mode="clip")
    for axis in range(3):
        low, high = faces[0] + axis, faces[1] + axis
        if octant >> axis & 1 and low == high:
            out[:, low] = out[:, low] << half | out[:, low] >> half
        elif octant >> axis & 1:
            lower = out[:, low].copy()
            out[:, low], out[:, high] = out[:, high], lower
    inner = np.flatnonzero(nodes.tested & (nodes.tree.count == 0))
    behind = (base + place[inner] + nodes.sizes[inner]).astype(np.uint32)
    out[place[inner], skip[0]] |= behind << np.uint32(skip[1])
