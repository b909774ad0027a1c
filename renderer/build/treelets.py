"""Better BVHs, a treelet at a time: a node and a few levels below it, made anew at the least SAH cost.

Karras and Aila 2013: of all binary trees over a treelet's leaves the cheapest is found by dynamic programming over sets
of them. A set of few triangles may become one leaf, which re-insertion (`reinsert`) does not look at.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.loose import Loose, adopt, copied, parents_first, triangles_below
from renderer.build.parallel import each
from renderer.build.spatial_split import row_area
from renderer.build.tree import MAX_BVH_LEAF, Floats, Ints, SahCosts
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

LEAVES = 7
"""Of a treelet."""

LEAVES_HIGH = 9
"""Of one whose root has more than the share HIGH of the tree's area; each more takes thrice the time."""

HIGH = 1e-4

TASK = 20_000
"""The most triangles below the node of one task."""

WON = 1e-9
"""The share of a treelet's cost that is worth a change: less is rounding."""


class _Sets(NamedTuple):
    """Of every set of a treelet's leaves, one bit each: the box around it, its triangles, the least cost of a tree over
    it, and the part of it that goes left there."""

    box: Floats
    triangles: Ints
    cost: Doubles
    left: Ints


class _Below(NamedTuple):
    """Of every node the triangles below it and the least cost of its subtree."""

    triangles: Ints
    cost: Doubles


def regrouped(tree: Loose, costs: SahCosts) -> Loose:
    """A copy of `tree` after every node's treelet, those far down first."""
    after = copied(tree)
    if not row_area(after.box, 0) > 0.0:
        return after
    nodes = parents_first(after.child, after.size, 0)
    below = _Below(triangles_below(after.child, after.size, nodes), np.empty(len(after.child), np.float64))
    large = below.triangles > TASK
    roots = nodes[~large[nodes] & ((nodes == 0) | large[after.parent[nodes]])]
    each([partial(_regroup_from, *after, below, root, costs.traversal, costs.intersection) for root in roots])
    _regroup_all(*after, below, nodes[large[nodes]], costs.traversal, costs.intersection)
    return after


@jit
def _regroup_from(
    box: Floats, child: Ints, size: Ints, parent: Ints, below: _Below, root: int, traversal: float, intersection: float
) -> None:
    _regroup_all(box, child, size, parent, below, parents_first(child, size, root), traversal, intersection)


@jit
def _regroup_all(
    box: Floats,
    child: Ints,
    size: Ints,
    parent: Ints,
    below: _Below,
    nodes: Ints,
    traversal: float,
    intersection: float,
) -> None:
    """Parents come first in `nodes`; what is below these was done before."""
    room = 1 << LEAVES_HIGH
    sets = _Sets(
        np.empty((room, 6), np.float32),
        np.empty(room, np.int32),
        np.empty(room, np.float64),
        np.empty(room, np.int32),
    )
    leaves, pairs = np.empty(LEAVES_HIGH, np.int32), np.empty(LEAVES_HIGH, np.int32)
    high = HIGH * row_area(box, 0)
    for i in range(len(nodes) - 1, -1, -1):
        node = nodes[i]
        area = row_area(box, node)
        if size[node] > 0:
            below.cost[node] = area * intersection * size[node]
            continue
        split = area * traversal + below.cost[child[node]] + below.cost[child[node] + 1]
        below.cost[node] = _merged(area * intersection, below.triangles[node], split)
        found = _cut_off(box, child, size, node, LEAVES_HIGH if area > high else LEAVES, leaves, pairs)
        if found > 2:
            _take_leaves(box, below, leaves, found, sets)
            whole = _weigh(sets, found, traversal, intersection)
            if sets.cost[whole] < below.cost[node] * (1.0 - WON):
                _put_together(box, child, size, parent, node, leaves, pairs, found, sets, below)


@jit
def _merged(share: float, count: int, split: float) -> float:
    """The cost of a subtree, as a leaf where that is cheaper."""
    return min(split, share * count) if count <= MAX_BVH_LEAF else split


@jit
def _cut_off(box: Floats, child: Ints, size: Ints, root: int, most: int, leaves: Ints, pairs: Ints) -> int:
    """The treelet's leaves, found by opening the largest, and the pairs of places that its nodes have."""
    leaves[0], leaves[1], pairs[0], found = child[root], child[root] + 1, child[root], 2
    while found < most:
        largest, widest = -1, -1.0
        for i in range(found):
            if size[leaves[i]] == 0:
                area = row_area(box, leaves[i])
                if area > widest:
                    largest, widest = i, area
        if largest < 0:
            break
        opened = child[leaves[largest]]
        pairs[found - 1] = opened
        leaves[largest], leaves[found] = opened, opened + 1
        found += 1
    return found


@jit
def _take_leaves(box: Floats, below: _Below, leaves: Ints, found: int, sets: _Sets) -> None:
    for i in range(found):
        for k in range(6):
            sets.box[1 << i, k] = box[leaves[i], k]
        sets.triangles[1 << i], sets.cost[1 << i] = below.triangles[leaves[i]], below.cost[leaves[i]]


@jit
def _weigh(sets: _Sets, found: int, traversal: float, intersection: float) -> int:
    """Fills in all sets, smaller ones first, and returns the whole one."""
    whole = (1 << found) - 1
    for chosen in range(3, whole + 1):
        first = chosen & -chosen
        others = chosen ^ first
        if others == 0:
            continue
        for k in range(3):
            sets.box[chosen, k] = min(sets.box[first, k], sets.box[others, k])
            sets.box[chosen, k + 3] = max(sets.box[first, k + 3], sets.box[others, k + 3])
        sets.triangles[chosen] = sets.triangles[first] + sets.triangles[others]
        least, left = np.inf, 0
        some = others
        while some != 0:
            some = (some - 1) & others
            cost = sets.cost[first | some] + sets.cost[others ^ some]
            if cost < least:
                least, left = cost, first | some
        area = row_area(sets.box, chosen)
        sets.cost[chosen] = _merged(area * intersection, sets.triangles[chosen], area * traversal + least)
        sets.left[chosen] = left
    return whole


@jit
def _put_together(
    box: Floats,
    child: Ints,
    size: Ints,
    parent: Ints,
    root: int,
    leaves: Ints,
    pairs: Ints,
    found: int,
    sets: _Sets,
    below: _Below,
) -> None:
    """Makes the treelet's best tree, in the pairs of places that it had."""
    links = np.empty((LEAVES_HIGH, 2), np.int32)
    for i in range(found):
        links[i, 0], links[i, 1] = child[leaves[i]], size[leaves[i]]
    waiting, chosen = np.empty(LEAVES_HIGH, np.int32), np.empty(LEAVES_HIGH, np.int32)
    waiting[0], chosen[0], top, used = root, (1 << found) - 1, 1, 0
    while top > 0:
        top -= 1
        node, own = waiting[top], chosen[top]
        for k in range(6):
            box[node, k] = sets.box[own, k]
        below.triangles[node], below.cost[node] = sets.triangles[own], sets.cost[own]
        if own & (own - 1) == 0:
            leaf = 0
            while 1 << leaf != own:
                leaf += 1
            child[node], size[node] = links[leaf, 0], links[leaf, 1]
        else:
            child[node], size[node] = pairs[used], 0
            waiting[top], chosen[top] = pairs[used], sets.left[own]
            waiting[top + 1], chosen[top + 1] = pairs[used] + 1, own ^ sets.left[own]
            top += 2
            used += 1
        adopt(child, size, parent, node)
