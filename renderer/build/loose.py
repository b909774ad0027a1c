"""A binary tree while it is worked on, and its way back into the order that `Bvh` promises."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized
from renderer.build.refit import depth_of, fit_boxes, sah_cost
from renderer.build.spatial_split import row_area
from renderer.build.tree import MAX_BVH_LEAF, Bvh, Bytes, Floats, Ints, SahCosts
from renderer.jit import jit

Flags = npt.NDArray[np.bool_]


class Loose(NamedTuple):
    """n nodes in any order but for siblings, which are adjacent; node 0 is the root.

    `box` (n, 6) float32; `child` (n,) int32: the left child, or a leaf's first slot; `slots` (n,): 0 for an inner node,
    else the leaf's slots; `parent` (n,), -1 for the root. A leaf's slots are some range, leaves' ranges in any order.
    """

    box: Floats
    child: Ints
    slots: Ints
    parent: Ints


def reach_of(tree: Loose) -> int:
    """Edges on the longest path from the root."""
    return int(_reach(tree.child, tree.slots))


@jit
def _reach(child: Ints, count: Ints) -> int:
    waiting, depths = np.empty(len(child) + 1, np.int32), np.empty(len(child) + 1, np.int32)
    waiting[0], depths[0], top, deepest = 0, 0, 1, 0
    while top > 0:
        top -= 1
        node, depth = waiting[top], depths[top]
        deepest = max(deepest, depth)
        if count[node] == 0:
            waiting[top], waiting[top + 1] = child[node] + 1, child[node]
            depths[top], depths[top + 1] = depth + 1, depth + 1
            top += 2
    return deepest


def settled(tree: Loose, ids: Ints, boxes: Floats, costs: SahCosts) -> Bvh:
    """The `Bvh` of a tree over r references: their triangles, `ids` (r,), and their boxes (r, 2, 3) float32.

    Subtrees become leaves where that costs no more, and references of one triangle in one leaf become one. An inner
    node's axis is that along which its children's centres lie farthest apart.
    """
    nodes = _parents_first(tree.child, tree.slots)
    leaf = _leaves(nodes, tree.box, tree.child, tree.slots, costs.traversal, costs.intersection)
    child, count, axis, parent, order, kept = _laid_out(tree.box, tree.child, tree.slots, leaf, ids, boxes)
    lower, upper = fit_boxes(kept, child, count, np.arange(len(order), dtype=np.int32))
    cost = sah_cost(lower, upper, count > 0, count, costs.traversal, costs.intersection)
    return Bvh(lower, upper, child, count, axis, parent, order, depth_of(parent), cost)


@jit
def _parents_first(child: Ints, count: Ints) -> Ints:
    nodes = np.empty(len(child), np.int32)
    nodes[0], made = 0, 1
    for i in range(len(child)):
        if count[nodes[i]] == 0:
            nodes[made], nodes[made + 1] = child[nodes[i]], child[nodes[i]] + 1
            made += 2
    return nodes


@jit
def _leaves(nodes: Ints, box: Floats, child: Ints, count: Ints, traversal: float, intersection: float) -> Flags:
    """Which nodes are leaves in the tree of least SAH cost whose nodes are all among these."""
    size, least = count.copy(), np.empty(len(child), np.float64)
    leaf = count > 0
    flat = not row_area(box, 0) > 0.0
    for i in range(len(nodes) - 1, -1, -1):
        node = nodes[i]
        area = 1.0 if flat else row_area(box, node)
        if leaf[node]:
            least[node] = area * intersection * count[node]
            continue
        left = child[node]
        size[node] = size[left] + size[left + 1]
        inner = area * traversal + least[left] + least[left + 1]
        merged = area * intersection * size[node]
        leaf[node] = size[node] <= MAX_BVH_LEAF and merged <= inner
        least[node] = merged if leaf[node] else inner
    return leaf


@jit
def _laid_out(
    box: Floats, child: Ints, count: Ints, leaf: Flags, ids: Ints, boxes: Floats
) -> tuple[Ints, Ints, Bytes, Ints, Ints, Floats]:
    """Nodes left first with siblings adjacent, and below each leaf its references, with their boxes."""
    new_child, new_count = np.zeros(len(child), np.int32), np.zeros(len(child), np.int32)
    new_axis, new_parent = np.zeros(len(child), np.uint8), np.full(len(child), np.int32(-1))
    order, kept = np.empty_like(ids), np.empty_like(boxes)
    waiting, places = np.empty(len(child) + 1, np.int32), np.empty(len(child) + 1, np.int32)
    waiting[0], places[0], top, made, filled = 0, 0, 1, 1, 0
    while top > 0:
        top -= 1
        node, place = waiting[top], places[top]
        if leaf[node]:
            new_child[place] = filled
            filled = _take_all(child, count, node, ids, boxes, order, kept, filled)
            new_count[place] = filled - new_child[place]
            continue
        axis, turned = _orientation(box, child[node])
        new_child[place], new_axis[place] = made, axis
        new_parent[made], new_parent[made + 1] = place, place
        waiting[top], places[top] = child[node] + 1 - turned, made + 1
        waiting[top + 1], places[top + 1] = child[node] + turned, made
        top += 2
        made += 2
    nodes = (resized(new_child, made), resized(new_count, made), resized(new_axis, made), resized(new_parent, made))
    return (*nodes, order[:filled].copy(), kept[:filled].copy())


@jit
def _take_all(
    child: Ints, count: Ints, root: int, ids: Ints, boxes: Floats, order: Ints, kept: Floats, filled: int
) -> int:
    """Appends the references below a node, those of one triangle as one, and returns how many there are now."""
    first = filled
    waiting = np.empty(2 * MAX_BVH_LEAF, np.int32)
    waiting[0], top = root, 1
    while top > 0:
        top -= 1
        node = waiting[top]
        if count[node] == 0:
            waiting[top], waiting[top + 1] = child[node] + 1, child[node]
            top += 2
            continue
        for slot in range(child[node], child[node] + count[node]):
            at = first
            while at < filled and order[at] != ids[slot]:
                at += 1
            new = at == filled
            filled += int(new)
            order[at] = ids[slot]
            for k in range(3):
                kept[at, 0, k] = boxes[slot, 0, k] if new else min(kept[at, 0, k], boxes[slot, 0, k])
                kept[at, 1, k] = boxes[slot, 1, k] if new else max(kept[at, 1, k], boxes[slot, 1, k])
    return filled


@jit
def _orientation(box: Floats, left: int) -> tuple[int, int]:
    axis, widest, turned = 0, -1.0, 0
    for k in range(3):
        apart = np.float64(box[left + 1, k]) + np.float64(box[left + 1, k + 3])
        apart -= np.float64(box[left, k]) + np.float64(box[left, k + 3])
        if abs(apart) > widest:
            axis, widest, turned = k, abs(apart), int(apart < 0.0)
    return axis, turned
