"""Which nodes of a binary BVH to keep where one may have many children, by dynamic programming.

Wald et al. 2008; Ylitie et al. 2017, section 4. A node that is kept stands for its whole tree; in the place of one that
is not stand several trees, children of a kept one above.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bytes, Ints
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

MAX_WIDTH = 8

FEWER = 0x80
SHARE = 7


@jit
def ranges(child: Ints, count: Ints) -> tuple[Ints, Ints]:
    """The triangles below each node, and the first of the slots that they fill."""
    sizes, firsts = count.copy(), child.copy()
    for node in range(len(child) - 1, -1, -1):
        if count[node] == 0:
            sizes[node] = sizes[child[node]] + sizes[child[node] + 1]
            firsts[node] = firsts[child[node]]
    return sizes, firsts


@jit
def price(
    weight: Doubles,
    child: Ints,
    count: Ints,
    sizes: Ints,
    width: int,
    max_leaf: int,
    visit: float,
    test: float,
    triangle: float,
) -> tuple[float, Bytes]:
    """The least cost of the root's tree, and how it is reached: `choice` (n, width).

    `weight` (n,) is how often a node's box is entered. Then a kept inner node costs `visit`, and `test` for each of its
    2 to `width` children, a leaf `triangle` for each of its triangles; leaves of up to `max_leaf` are merged where that
    costs no more. choice[node, 0] says how many children a node has if it is kept, 0 if it is a leaf. For j > 0, SHARE
    of choice[node, j] says how many of at most j + 1 trees in its place its left child has, FEWER that j cost no more.
    """
    least = np.empty((len(child), width), np.float64)
    choice = np.zeros((len(child), width), np.uint8)
    for node in range(len(child) - 1, -1, -1):
        leaf = weight[node] * triangle * sizes[node]
        if count[node] > 0:
            for j in range(width):
                least[node, j] = leaf
                choice[node, j] = FEWER if j > 0 else 0
            continue
        for j in range(1, width):
            least[node, j], choice[node, j] = _share(least, child[node], j)
        inner, trees = np.inf, 0
        for j in range(width - 1, 0, -1):
            cost = weight[node] * (visit + test * (j + 1)) + least[node, j]
            if cost < inner:
                inner, trees = cost, j + 1
        merged = sizes[node] <= max_leaf and leaf <= inner
        least[node, 0], choice[node, 0] = (leaf, 0) if merged else (inner, trees)
        for j in range(1, width):
            if least[node, j - 1] <= least[node, j]:
                least[node, j] = least[node, j - 1]
                choice[node, j] |= FEWER
    return least[0, 0], choice


@jit
def _share(least: Doubles, left: int, j: int) -> tuple[float, int]:
    """The least cost of at most j + 1 trees for two siblings, and how many of them are the left one's."""
    best, trees = np.inf, 1
    for k in range(1, j + 1):
        cost = least[left, k - 1] + least[left + 1, j - k]
        if cost < best:
            best, trees = cost, k
    return best, trees


@jit
def shares(choice: Bytes, node: int) -> tuple[int, int]:
    """How many of a kept inner node's children come from its left and from its right child."""
    left = choice[node, choice[node, 0] - 1] & SHARE
    return left, choice[node, 0] - left


@jit
def shares_in_place(choice: Bytes, node: int, most: int) -> tuple[int, int]:
    """How many of at most `most` trees in a node's place are its left and its right child's; none where it is kept."""
    while most > 1 and choice[node, most - 1] & FEWER:
        most -= 1
    if most == 1:
        return 0, 0
    left = choice[node, most - 1] & SHARE
    return left, most - left
