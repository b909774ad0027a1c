"""The two structures as the builders return them, before any traversal's node layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Bytes = npt.NDArray[np.uint8]
Doubles = npt.NDArray[np.float64]

Builder = Literal["sah", "binned", "median", "reinserted", "sbvh", "sbvh-reinserted", "clipped"]
"""How a tree is built: a BVH by any of them, a KD-tree by `sah` or `clipped`."""

MAX_BVH_LEAF = 63
"""The most triangles a BVH leaf may hold; node layouts give the count six bits."""

EMPTY = -1
"""The `count` of a place that holds no child."""

KD_LEAF = 3
"""The `axis` of a KD-tree's leaf."""

MAX_DEPTH = 64
"""The deepest level a builder may reach; a restart trail holds one bit a level in two words."""


@dataclass(frozen=True)
class SahCosts:
    """The costs of the surface area heuristic (paper section 3.2.1): one node visit, one triangle test."""

    traversal: float = 3.0
    intersection: float = 1.5


@dataclass(frozen=True, eq=False)
class Bvh:
    """A binary BVH over n nodes; node 0 is the root, siblings are adjacent.

    `lower`, `upper` (n, 3) float32 boxes. `child` (n,) int32: an inner node's left child (its right child is
    the next node) or a leaf's first slot in `order`. `count` (n,) int32: 0 for an inner node, else the leaf's
    triangles. `axis` (n,) uint8: an inner node's split axis; the left child is the lower one along it.
    `parent` (n,) int32, -1 for the root. `order` (r,) int32: slot -> triangle of the scene; r is more
    than the scene's m where spatial splits cut triangles. `depth`: edges on the
    longest path from the root. `cost`: the SAH cost, sum over nodes of area / root area times the node's cost.
    `epo`: the end-point overlap (`renderer.build.epo`), None where it was not estimated. The slots below a node are one
    range, those of its left child first.
    """

    lower: Floats
    upper: Floats
    child: Ints
    count: Ints
    axis: Bytes
    parent: Ints
    order: Ints
    depth: int
    cost: float
    epo: float | None = None


@dataclass(frozen=True, eq=False)
class Kd:
    """A KD-tree over n nodes; node 0 is the root, siblings are adjacent.

    `lower`, `upper` (n, 3) float32 cells. `split` (n,) float32 plane of an inner node. `axis` (n,) uint8: its axis,
    3 for a leaf. `child` (n,) int32: left child (the right child is the next node) or a leaf's first entry in
    `refs`. `count` (n,) int32: a leaf's entries (0 for an empty leaf), 0 for an inner node. `parent` (n,) int32, -1
    for the root. `refs` (r,) int32 triangles of the scene. `depth`, `cost` and `epo` as in `Bvh`.
    """

    lower: Floats
    upper: Floats
    split: Floats
    axis: Bytes
    child: Ints
    count: Ints
    parent: Ints
    refs: Ints
    depth: int
    cost: float
    epo: float | None = None


@dataclass(frozen=True, eq=False)
class WideBvh:
    """A BVH of n nodes with up to `width` children each; node 0 is the root, and parents come before children.

    A node's children fill its first places, in the order of the binary tree; what follows is empty. `lower`, `upper`
    (n, width, 3) float32: the children's boxes, inf and -inf where empty. `count` (n, width) int32: 0 for an inner
    child, the triangles of a leaf, or EMPTY. `child` (n, width) int32: an inner child's node, a leaf's first slot
    in `order`, or 0 where empty. A node's inner children are consecutive nodes, and its leaves' slots one range, both
    in the order of their places. `order` (r,) int32: slot -> triangle of the scene. `depth`: edges between nodes on
    the longest path from the root. `waiting`: the most children of nodes on a path that can still wait for a visit
    while another is at work, whatever the order. `cost`: sum over nodes of area / root area times the cost of a visit,
    plus that of the leaves' triangles. Where the whole tree is a leaf, the root has it for its only child.
    """

    width: int
    lower: Floats
    upper: Floats
    child: Ints
    count: Ints
    order: Ints
    depth: int
    waiting: int
    cost: float


Tree = Bvh | Kd


def half_areas(size: Doubles) -> Doubles:
    """Half the surface of boxes of these sizes, (n, 3), to the bits of `renderer.build.refit.half_area`."""
    x, y, z = size.T
    areas: Doubles = x * y + z * (x + y)
    return areas
