"""The BVH: a full SAH sweep, or a centroid median split."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized
from renderer.build.radix import sort_keys, stable_order
from renderer.build.refit import depth_of, fit_boxes, sah_cost
from renderer.build.spatial import normalised, spatial_order
from renderer.build.sweep import MEDIAN_LEAF, NO_SPLIT, Rules, median_split, sah_split
from renderer.build.tree import MAX_BVH_LEAF, MAX_DEPTH, Bvh, Bytes, Floats, Ints, SahCosts
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
BvhMethod = Literal["sah", "median"]


def build_bvh(boxes: Floats, costs: SahCosts, method: BvhMethod = "sah", max_depth: int = MAX_DEPTH) -> Bvh:
    """The BVH over m >= 1 triangle bounds, (m, 2, 3) float32, finite.

    "sah" cuts each node where the surface area heuristic is least over all cuts of the centroids' order on three
    axes, and makes a leaf where that costs no more; "median" cuts the longest axis in the middle down to leaves
    of 4, and so does the other where its splits could lead below `max_depth`. That bound holds for up to
    2**max_depth triangles. Every list is sorted once and partitioned stably, so equal input gives equal bytes.
    Raises ValueError for no triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    near = spatial_order(boxes)
    work = normalised(boxes, near)
    lists = np.stack([stable_order(sort_keys(work[:, axis] + work[:, axis + 3])) for axis in range(3)])
    rules = Rules(method == "sah", min(max_depth, MAX_DEPTH), costs.traversal, costs.intersection)
    child, count, axis, parent = _split_all(work, lists, rules)
    order = near[lists[0]].view(np.int32)
    lower, upper = fit_boxes(boxes, child, count, order)
    cost = sah_cost(lower, upper, count > 0, count, costs.traversal, costs.intersection)
    return Bvh(lower, upper, child, count, axis, parent, order, depth_of(parent), cost)


@jit
def _split_all(boxes: Floats, lists: Words, rules: Rules) -> tuple[Ints, Ints, Bytes, Ints]:
    """Splits the root's range until all are leaves, left first; returns child, count, axis and parent.

    A node that waits is already written as a leaf over its range of `lists`, so leaves need no further work.
    """
    most = 2 * lists.shape[1] - 1
    child, count = np.zeros(most, np.int32), np.zeros(most, np.int32)
    axis, parent = np.zeros(most, np.uint8), np.zeros(most, np.int32)
    parent[0] = -1
    areas, moved = np.empty(lists.shape[1], np.float32), np.empty(lists.shape[1], np.uint32)
    is_right = np.zeros(lists.shape[1], np.uint8)
    waiting, depths = np.zeros(MAX_DEPTH + 2, np.int64), np.zeros(MAX_DEPTH + 2, np.int64)
    count[0], top, made = lists.shape[1], 1, 1
    while top > 0:
        top -= 1
        node, depth = waiting[top], depths[top]
        begin, end = child[node], child[node] + count[node]
        chosen, cut = _choose(boxes, lists, areas, begin, end, depth, rules)
        if chosen == NO_SPLIT:
            continue
        _partition(lists, is_right, moved, chosen, begin, cut, end)
        _make_children(child, count, parent, node, made, begin, cut, end)
        axis[node] = chosen
        waiting[top], depths[top] = made + 1, depth + 1
        waiting[top + 1], depths[top + 1] = made, depth + 1
        top += 2
        made += 2
    return resized(child, made), resized(count, made), resized(axis, made), resized(parent, made)


@jit
def _choose(
    boxes: Floats,
    lists: Words,
    areas: Floats,
    begin: int,
    end: int,
    depth: int,
    rules: Rules,
) -> tuple[int, int]:
    """The split of a node; medians where SAH cannot bound the depth or asks for too large a leaf."""
    size = end - begin
    if size == 1:
        return NO_SPLIT, begin
    if not rules.use_sah or depth + 1 + _levels(size - 1) > rules.max_depth:
        return (NO_SPLIT, begin) if size <= MEDIAN_LEAF else median_split(boxes, lists, begin, end)
    chosen, cut = sah_split(boxes, lists, areas, begin, end, rules)
    if chosen == NO_SPLIT and size > MAX_BVH_LEAF:
        return median_split(boxes, lists, begin, end)
    return chosen, cut


@jit
def _levels(size: int) -> int:
    """The depth of a balanced tree with `size` leaves: ceil(log2(size))."""
    levels = 0
    while (1 << levels) < size:
        levels += 1
    return levels


@jit
def _make_children(
    child: Ints, count: Ints, parent: Ints, node: int, made: int, begin: int, cut: int, end: int
) -> None:
    child[node], count[node] = made, 0
    child[made], count[made], parent[made] = begin, cut - begin, node
    child[made + 1], count[made + 1], parent[made + 1] = cut, end - cut, node


@jit
def _partition(lists: Words, is_right: Bytes, moved: Words, chosen: int, begin: int, cut: int, end: int) -> None:
    """Splits the two other axes' lists as `chosen` is split at `cut`, keeping the order within each side."""
    for i in range(begin, cut):
        is_right[lists[chosen, i]] = 0
    for i in range(cut, end):
        is_right[lists[chosen, i]] = 1
    for axis in range(3):
        if axis == chosen:
            continue
        left, right = np.uint64(begin), np.uint64(0)
        for i in range(begin, end):
            box = lists[axis, i]
            lists[axis, left] = box
            moved[right] = box
            right += np.uint64(is_right[box])
            left += np.uint64(1 - is_right[box])
        for i in range(end - cut):
            lists[axis, cut + i] = moved[i]
