"""Wide BVHs: the collapse of a binary one that costs least (Wald et al. 2008; Ylitie et al. 2017, section 4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized_rows
from renderer.build.refit import half_area
from renderer.build.tree import EMPTY, MAX_BVH_LEAF, Bvh, Bytes, Floats, Ints, SahCosts, WideBvh
from renderer.jit import jit

MAX_WIDTH = 8

_FEWER = 0x80
_LEAF, _INNER = 0, 1


def collapse(tree: Bvh, costs: SahCosts, width: int = 4, max_leaf: int = MAX_BVH_LEAF) -> WideBvh:
    """The wide BVH of least SAH cost that merges nodes of `tree`, by dynamic programming; `width` is 2 to 8.

    `costs.traversal` is what a visit of a wide node costs. Leaves are merged, up to `max_leaf` triangles, where that
    costs no more; larger ones of `tree` stay as they are. Raises ValueError for another width.
    """
    if not 2 <= width <= MAX_WIDTH:
        raise ValueError(f"A wide BVH of {width} children a node cannot be made; take a width of 2 to {MAX_WIDTH}.")
    sizes, firsts = _ranges(tree.child, tree.count)
    cost, choice = _price(
        tree.lower, tree.upper, tree.child, tree.count, sizes, width, max_leaf, costs.traversal, costs.intersection
    )
    source, child, count, order = _expand(choice, tree.child, tree.order, sizes, firsts, width)
    depth, waiting = _reach(child, count)
    empty = (count == EMPTY)[:, :, np.newaxis]
    return WideBvh(
        width=width,
        lower=np.where(empty, np.float32(np.inf), tree.lower[source]),
        upper=np.where(empty, np.float32(-np.inf), tree.upper[source]),
        child=child,
        count=count,
        order=order,
        depth=depth,
        waiting=waiting,
        cost=cost,
    )


@jit
def _ranges(child: Ints, count: Ints) -> tuple[Ints, Ints]:
    """The triangles below each binary node, and the first of the slots that they fill."""
    sizes, firsts = count.copy(), child.copy()
    for node in range(len(child) - 1, -1, -1):
        if count[node] == 0:
            sizes[node] = sizes[child[node]] + sizes[child[node] + 1]
            firsts[node] = firsts[child[node]]
    return sizes, firsts


@jit
def _price(
    lower: Floats,
    upper: Floats,
    child: Ints,
    count: Ints,
    sizes: Ints,
    width: int,
    max_leaf: int,
    traversal: float,
    intersection: float,
) -> tuple[float, Bytes]:
    """The least cost of all, and how it is reached: `choice` (n, width).

    choice[node, 0] says whether the node's only tree is a leaf; choice[node, j] & 7 how many of at most j + 1 trees
    the left child has, and _FEWER that at most j of them cost no more.
    """
    least = np.empty((len(child), width), np.float64)
    choice = np.zeros((len(child), width), np.uint8)
    root = half_area(lower, upper, 0)
    for node in range(len(child) - 1, -1, -1):
        ratio = half_area(lower, upper, node) / root if root > 0.0 else 1.0
        leaf = ratio * intersection * sizes[node]
        if count[node] > 0:
            for j in range(width):
                least[node, j] = leaf
                choice[node, j] = _FEWER if j > 0 else _LEAF
            continue
        for j in range(1, width):
            least[node, j], choice[node, j] = _share(least, child[node], j)
        inner = ratio * traversal + least[node, width - 1]
        merged = sizes[node] <= max_leaf and leaf <= inner
        least[node, 0], choice[node, 0] = (leaf, _LEAF) if merged else (inner, _INNER)
        for j in range(1, width):
            if least[node, j - 1] <= least[node, j]:
                least[node, j] = least[node, j - 1]
                choice[node, j] |= _FEWER
    return least[0, 0] + (traversal if choice[0, 0] == _LEAF else 0.0), choice


@jit
def _share(least: npt.NDArray[np.float64], left: int, j: int) -> tuple[float, int]:
    """The least cost of at most j + 1 trees for two siblings, and how many of them are the left one's."""
    best, trees = np.inf, 1
    for k in range(1, j + 1):
        cost = least[left, k - 1] + least[left + 1, j - k]
        if cost < best:
            best, trees = cost, k
    return best, trees


@jit
def _expand(
    choice: Bytes, child: Ints, order: Ints, sizes: Ints, firsts: Ints, width: int
) -> tuple[Ints, Ints, Ints, Ints]:
    """The binary node behind each place (n, width), `child` and `count` of the wide nodes, and the slots' triangles."""
    room = max(1, len(child) // 2)
    source, link = np.zeros((room, width), np.int32), np.zeros((room, width), np.int32)
    count = np.full((room, width), np.int32(EMPTY))
    slots, origin = np.empty_like(order), np.zeros(room, np.int32)
    waiting, trees = np.empty(2 * width, np.int32), np.empty(2 * width, np.int32)
    made, filled, node = 1, 0, 0
    while node < made:
        places = _gather(choice, child, origin[node], width, waiting, trees, source[node])
        for place in range(places):
            below = source[node, place]
            if choice[below, 0] == _INNER:
                link[node, place], count[node, place], origin[made] = made, 0, below
                made += 1
                continue
            link[node, place], count[node, place] = filled, sizes[below]
            for i in range(firsts[below], firsts[below] + sizes[below]):
                slots[filled] = order[i]
                filled += 1
        node += 1
    return resized_rows(source, made), resized_rows(link, made), resized_rows(count, made), slots


@jit
def _gather(choice: Bytes, child: Ints, root: int, width: int, waiting: Ints, trees: Ints, found: Ints) -> int:
    """Fills `found` with the binary nodes that become the children of `root`, and returns their number."""
    if choice[root, 0] == _LEAF:
        found[0] = root
        return 1
    places, top = 0, 1
    waiting[0], trees[0] = root, width
    while top > 0:
        top -= 1
        node, most = waiting[top], trees[top]
        while most > 1 and node != root and choice[node, most - 1] & _FEWER:
            most -= 1
        if most == 1:
            found[places] = node
            places += 1
            continue
        share = choice[node, most - 1] & 7
        waiting[top], trees[top] = child[node] + 1, most - share
        waiting[top + 1], trees[top + 1] = child[node], share
        top += 2
    return places


@jit
def _reach(child: Ints, count: Ints) -> tuple[int, int]:
    """The depth, and the most children that wait beside one path."""
    depth, waiting = np.zeros(len(child), np.int32), np.zeros(len(child), np.int32)
    deepest, most = 0, 0
    for node in range(len(child)):
        places = 0
        for place in range(child.shape[1]):
            places += count[node, place] != EMPTY
        most = max(most, waiting[node] + places - 1)
        deepest = max(deepest, depth[node])
        for place in range(places):
            if count[node, place] == 0:
                depth[child[node, place]] = depth[node] + 1
                waiting[child[node, place]] = waiting[node] + places - 1
    return deepest, most
