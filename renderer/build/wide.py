"""Wide BVHs: the collapse of a binary one that costs least (Wald et al. 2008; Ylitie et al. 2017, section 4)."""

from __future__ import annotations

import numpy as np

from renderer.build.grow import resized_rows
from renderer.build.levels import first_slots, inner_levels, summed
from renderer.build.merging import FEWER, MAX_WIDTH, SHARE, price
from renderer.build.tree import EMPTY, MAX_BVH_LEAF, Bvh, Bytes, Ints, SahCosts, WideBvh, half_areas
from renderer.jit import jit


def collapse(tree: Bvh, costs: SahCosts, width: int = 4, max_leaf: int = MAX_BVH_LEAF) -> WideBvh:
    """The wide BVH of least SAH cost that merges nodes of `tree`, by dynamic programming; `width` is 2 to 8.

    `costs.traversal` is what a visit of a wide node costs. Leaves are merged, up to `max_leaf` triangles, where that
    costs no more; larger ones of `tree` stay as they are. Raises ValueError for another width.
    """
    if not 2 <= width <= MAX_WIDTH:
        raise ValueError(f"A wide BVH of {width} children a node cannot be made; take a width of 2 to {MAX_WIDTH}.")
    levels = inner_levels(tree.child, tree.count)
    sizes, firsts = summed(tree.count, tree.child, levels), first_slots(tree.child, levels)
    area = half_areas(tree.upper.astype(np.float64) - tree.lower)
    ratio = area / area[0] if area[0] > 0.0 else np.ones_like(area)
    cost, choice = price(ratio, tree.child, sizes, levels, width, max_leaf, costs.traversal, 0.0, costs.intersection)
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
        cost=cost + (costs.traversal if choice[0, 0] == 0 else 0.0),
    )


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
        places = _gather(choice, child, origin[node], waiting, trees, source[node])
        for place in range(places):
            below = source[node, place]
            if choice[below, 0] > 0:
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
def _gather(choice: Bytes, child: Ints, root: int, waiting: Ints, trees: Ints, found: Ints) -> int:
    """Fills `found` with the binary nodes that become the children of `root`, and returns their number."""
    if choice[root, 0] == 0:
        found[0] = root
        return 1
    trees[1], trees[0] = _shares(choice, root, choice[root, 0])
    waiting[1], waiting[0] = child[root], child[root] + 1
    places, top = 0, 2
    while top > 0:
        top -= 1
        node = waiting[top]
        most = trees[top]
        while most > 1 and choice[node, most - 1] & FEWER:
            most -= 1
        if most == 1:
            found[places] = node
            places += 1
            continue
        trees[top + 1], trees[top] = _shares(choice, node, most)
        waiting[top + 1], waiting[top] = child[node], child[node] + 1
        top += 2
    return places


@jit
def _shares(choice: Bytes, node: int, trees: int) -> tuple[int, int]:
    """How many of so many trees for a node's children are its left and its right child's."""
    left = choice[node, trees - 1] & SHARE
    return left, trees - left


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
