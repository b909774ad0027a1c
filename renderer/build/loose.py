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

    `box` (n, 6) float32; `child` (n,) int32: the left child, or a leaf's first slot; `size` (n,) int32: 0 for an inner
    node, else the leaf's slots; `parent` (n,) int32, -1 for the root. Leaves' ranges of slots lie in any order.
    """

    box: Floats
    child: Ints
    size: Ints
    parent: Ints


def copied(tree: Loose) -> Loose:
    """A copy to work on."""
    return Loose(tree.box.copy(), tree.child.copy(), tree.size.copy(), tree.parent.copy())


def loosened(tree: Bvh) -> Loose:
    """A `Bvh` to work on; its slots stay as they are."""
    return Loose(np.hstack([tree.lower, tree.upper]), tree.child.copy(), tree.count.copy(), tree.parent.copy())


@jit
def union_area(box: Floats, a: int, b: int) -> float:
    """Half the surface of the box around two nodes'."""
    x = np.float64(max(box[a, 3], box[b, 3])) - np.float64(min(box[a, 0], box[b, 0]))
    y = np.float64(max(box[a, 4], box[b, 4])) - np.float64(min(box[a, 1], box[b, 1]))
    z = np.float64(max(box[a, 5], box[b, 5])) - np.float64(min(box[a, 2], box[b, 2]))
    return x * y + z * (x + y)


@jit
def sibling_of(child: Ints, parent: Ints, node: int) -> int:
    """The other child of a node's parent."""
    left = child[parent[node]]
    return int(left + 1 if node == left else left)


@jit
def copy_node(box: Floats, child: Ints, count: Ints, source: int, target: int) -> None:
    """What is at one place to another; its children still name the old one (`adopt`)."""
    for k in range(6):
        box[target, k] = box[source, k]
    child[target], count[target] = child[source], count[source]


@jit
def adopt(child: Ints, count: Ints, parent: Ints, node: int) -> None:
    """Tells the children of what is at `node` so."""
    if count[node] == 0:
        parent[child[node]], parent[child[node] + 1] = node, node


@jit
def fit_upward(box: Floats, child: Ints, parent: Ints, start: int) -> None:
    """The boxes of an inner node and of all above it, made anew; -1 is above the root."""
    node = start
    while node >= 0:
        left = child[node]
        for k in range(3):
            box[node, k] = min(box[left, k], box[left + 1, k])
            box[node, k + 3] = max(box[left, k + 3], box[left + 1, k + 3])
        node = parent[node]


def reach_of(tree: Loose) -> int:
    """Edges on the longest path from the root."""
    return int(_reach(tree.child, tree.size))


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
    node's axis is that along which its children's centres lie farthest apart for their length.
    """
    nodes = parents_first(tree.child, tree.size, 0)
    leaf = _leaves(nodes, tree.box, tree.child, tree.size, costs.traversal, costs.intersection)
    child, count, axis, parent, order, kept = _laid_out(tree.box, tree.child, tree.size, leaf, ids, boxes)
    lower, upper = fit_boxes(kept, child, count, np.arange(len(order), dtype=np.int32))
    cost = sah_cost(lower, upper, count > 0, count, costs.traversal, costs.intersection)
    return Bvh(lower, upper, child, count, axis, parent, order, depth_of(parent), cost)


@jit
def parents_first(child: Ints, count: Ints, root: int) -> Ints:
    """The nodes from `root` down, each behind its parent."""
    nodes = np.empty(len(child), np.int32)
    nodes[0], made, i = root, 1, 0
    while i < made:
        if count[nodes[i]] == 0:
            nodes[made], nodes[made + 1] = child[nodes[i]], child[nodes[i]] + 1
            made += 2
        i += 1
    return nodes[:made]


@jit
def triangles_below(child: Ints, count: Ints, nodes: Ints) -> Ints:
    """Of every node the slots of the leaves below it; parents come first in `nodes`."""
    found = count.copy()
    for i in range(len(nodes) - 1, -1, -1):
        if count[nodes[i]] == 0:
            found[nodes[i]] = found[child[nodes[i]]] + found[child[nodes[i]] + 1]
    return found


@jit
def _leaves(nodes: Ints, box: Floats, child: Ints, count: Ints, traversal: float, intersection: float) -> Flags:
    """Which nodes are leaves in the tree of least SAH cost whose nodes are all among these."""
    size, least = triangles_below(child, count, nodes), np.empty(len(child), np.float64)
    leaf = count > 0
    flat = not row_area(box, 0) > 0.0
    for i in range(len(nodes) - 1, -1, -1):
        node = nodes[i]
        area = 1.0 if flat else row_area(box, node)
        if leaf[node]:
            least[node] = area * intersection * count[node]
            continue
        left = child[node]
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
    """The axis along which the centres lie farthest apart for their length, and 1 where the right one is the lower."""
    axis, widest, turned = 0, -1.0, 0
    for k in range(3):
        low, high = np.float64(box[left, k]), np.float64(box[left, k + 3])
        other_low, other_high = np.float64(box[left + 1, k]), np.float64(box[left + 1, k + 3])
        apart, length = other_low + other_high - low - high, max(high, other_high) - min(low, other_low)
        share = abs(apart) / length if length > 0.0 else 0.0
        if share > widest:
            axis, widest, turned = k, share, int(apart < 0.0)
    return axis, turned
