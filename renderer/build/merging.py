"""Which nodes of a binary BVH to keep where one may have many children, by dynamic programming.

Wald et al. 2008; Ylitie et al. 2017, section 4. A node that is kept stands for its whole tree; in the place of one that
is not stand several trees, children of a kept one above.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bytes, Ints

Doubles = npt.NDArray[np.float64]

MAX_WIDTH = 8

FEWER = 0x80
SHARE = 7


def price(
    weight: Doubles,
    child: Ints,
    sizes: Ints,
    levels: list[Ints],
    width: int,
    max_leaf: int,
    visit: float,
    test: float,
    triangle: float,
) -> tuple[float, Bytes]:
    """The least cost of the root's tree, and how it is reached: `choice` (n, width).

    `weight` (n,) is how often a node's box is entered, `sizes` (n,) the triangles below it, `levels` the inner nodes.
    Then a kept inner node costs `visit`, and `test` for each of its 2 to `width` children, a leaf `triangle` for each
    of its triangles; leaves of up to `max_leaf` are merged where that costs no more. choice[node, 0] says how many
    children a node has if it is kept, 0 if it is a leaf. For j > 0, SHARE of choice[node, j] says how many of at most
    j + 1 trees in its place its left child has, FEWER that j cost no more.
    """
    leaf = weight * triangle * sizes
    least = np.repeat(leaf[:, np.newaxis], width, axis=1)
    choice = np.full((len(child), width), FEWER, np.uint8)
    choice[:, 0] = 0
    for inner in reversed(levels):
        cost, how = _shared(least[child[inner]].T, least[child[inner] + 1].T)
        entered, merged = weight[inner], leaf[inner]
        for j in range(width - 1, 0, -1):
            kept = entered * (visit + test * (j + 1)) + cost[j]
            np.copyto(how[0], j + 1, where=kept < cost[0])
            np.minimum(cost[0], kept, out=cost[0])
        pays = (sizes[inner] <= max_leaf) & (merged <= cost[0])
        np.copyto(how[0], 0, where=pays)
        np.copyto(cost[0], merged, where=pays)
        for j in range(1, width):
            how[j] |= np.where(cost[j - 1] <= cost[j], FEWER, 0).astype(np.uint8)
            np.minimum(cost[j], cost[j - 1], out=cost[j])
        least[inner], choice[inner] = cost.T, how.T
    return float(least[0, 0]), choice


def _shared(left: Doubles, right: Doubles) -> tuple[Doubles, Bytes]:
    """For each j > 0 the least cost of at most j + 1 trees for two siblings, and how many of them are the left one's.

    All arrays are (width, nodes); for j = 0 the cost is infinite.
    """
    cost, trees = np.full(left.shape, np.inf), np.ones(left.shape, np.uint8)
    for j in range(1, len(left)):
        for k in range(1, j + 1):
            shared = left[k - 1] + right[j - k]
            np.copyto(trees[j], k, where=shared < cost[j])
            np.minimum(cost[j], shared, out=cost[j])
    return cost, trees
