"""The BVH from the top down: a full SAH sweep, a faster one that cuts large nodes between bins, or median splits."""

from __future__ import annotations

from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.binned import binned_split
from renderer.build.bounded import bounded_split
from renderer.build.grow import resized, resized_rows
from renderer.build.parallel import each
from renderer.build.progress import TOP_SHARE, Told, untold, within
from renderer.build.radix import sort_keys, stable_order
from renderer.build.refit import depth_of, fit_boxes, sah_cost
from renderer.build.sorted_range import sort_range
from renderer.build.spatial import normalised, spatial_order
from renderer.build.sweep import MEDIAN_LEAF, NO_SPLIT, Rules, few_split, median_split, pair_split, sah_split
from renderer.build.tree import MAX_BVH_LEAF, MAX_DEPTH, Bvh, Bytes, Floats, Ints, SahCosts
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
BvhMethod = Literal["sah", "median", "binned"]

TASK = 1 << 15
"""Nodes of at most so many triangles are a task of their own."""

ROOM = 2 * TASK
"""Nodes for which there is room at first: a task's never grow."""

SMALL = 2048
BINNED_SMALL = 256
"""Nodes of at most so many triangles are swept in sorted lists; the second is of "binned"."""

BINNED_FEW = 6
"""Nodes of "binned" of at most so many are swept along one axis."""


class Work(NamedTuple):
    """What tasks share, each within its own range of slots; i is a box's place, not its triangle.

    `boxes` (m, 6) float32; `ids` (m,) uint32: what moves with the boxes; `lists` (3, m) uint32: places along each axis,
    where a range is sorted; scratch: `areas`, `is_right`, `moved` (m,), `moved_boxes` (m, 6) if a sweep moves boxes.
    numpy makes them, whose large arrays take large pages: compiled code's take a fault every 4 KiB.
    """

    boxes: Floats
    ids: Words
    lists: Words
    areas: Floats
    is_right: Bytes
    moved: Words
    moved_boxes: Floats


Cells = npt.NDArray[np.int64]
"""Nodes that wait, (w, 5): node, begin and end of its slots, depth, and whether they are sorted."""

Part = tuple[Ints, Ints, Bytes, Ints, Cells]
"""A subtree: `child`, `count`, `axis` and `parent` of its nodes, its root first, and those of them that wait."""


def build_bvh(
    boxes: Floats, costs: SahCosts, method: BvhMethod = "sah", max_depth: int = MAX_DEPTH, told: Told = untold
) -> Bvh:
    """The BVH over m >= 1 triangle bounds, (m, 2, 3) float32, finite.

    "sah" cuts each node where the surface area heuristic is least over all cuts of the centroids' order on three
    axes, and makes a leaf where that costs no more; "binned" does so in small nodes, and cuts larger ones between
    bins along their longest axis. "median" cuts the longest axis in the middle down to leaves of 4, and so do the
    others where their splits could lead below `max_depth`. That bound holds for up to 2**max_depth triangles.
    Equal input gives equal bytes. Raises ValueError for no triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    work = _sorted_work(boxes) if method == "median" else _unsorted_work(boxes, method == "sah")
    rules = Rules(method != "median", min(max_depth, MAX_DEPTH), costs.traversal, costs.intersection, method == "sah")
    first = split_range(*work, 0, len(boxes), 0, int(method == "median"), rules, TASK)
    cells: list[list[int]] = first[4].tolist()
    tasks = [
        partial(split_range, *work, begin, end, depth, in_order, rules, 0) for _, begin, end, depth, in_order in cells
    ]
    child, count, axis, parent = _joined(first, each(tasks, within(told, TOP_SHARE, 1.0)))
    places = work.lists[0].view(np.int32)
    order = work.ids[places].view(np.int32)
    lower, upper = fit_boxes(boxes, child, count, order)
    cost = sah_cost(lower, upper, count > 0, count, costs.traversal, costs.intersection)
    return Bvh(lower, upper, child, count, axis, parent, order, depth_of(parent), cost)


def _sorted_work(boxes: Floats) -> Work:
    near = spatial_order(boxes)
    work = normalised(boxes, near)
    keys = [partial(_order_along, work, axis) for axis in range(3)]
    return _work(work, near, np.stack(each(keys)), 0)


def _order_along(boxes: Floats, axis: int) -> Words:
    return stable_order(sort_keys(boxes[:, axis] + boxes[:, axis + 3]))


def _unsorted_work(boxes: Floats, exact: bool) -> Work:
    as_given = np.arange(len(boxes), dtype=np.uint32)
    lists = np.empty((3, len(boxes)), np.uint32)
    return _work(normalised(boxes, as_given), as_given, lists, len(boxes) if exact else 0)


def _work(boxes: Floats, ids: Words, lists: Words, moving: int) -> Work:
    m = len(boxes)
    areas, is_right, moved = np.empty(m, np.float32), np.empty(m, np.uint8), np.empty(m, np.uint32)
    return Work(boxes, ids, lists, areas, is_right, moved, np.empty((moving, 6), np.float32))


def _joined(first: Part, parts: list[Part]) -> tuple[Ints, Ints, Bytes, Ints]:
    """One tree of a part and those of its nodes that wait, numbered as if one walk had made it: left first."""
    below = {int(cell[0]): part for cell, part in zip(first[4], parts, strict=True)}
    total = len(first[0]) + sum(len(part[0]) - 1 for part in parts)
    child, count = np.empty(total, np.int32), np.empty(total, np.int32)
    axis, parent = np.empty(total, np.uint8), np.empty(total, np.int32)
    waiting, made = [(0, 0, -1)], 1
    while waiting:
        node, place, above = waiting.pop()
        source, at = (below[node], 0) if node in below else (first, node)
        child[place], count[place], axis[place] = source[0][at], source[1][at], source[2][at]
        parent[place] = above
        if node in below:
            made = _append(source, place, made, child, count, axis, parent)
        elif count[place] == 0:
            left = int(child[place])
            child[place] = made
            waiting += [(left + 1, made + 1, place), (left, made, place)]
            made += 2
    return child, count, axis, parent


def _append(part: Part, place: int, made: int, child: Ints, count: Ints, axis: Bytes, parent: Ints) -> int:
    """Puts a part's nodes at `made` and after, but for its root, which is at `place`; returns where the next go."""
    end = made + len(part[0]) - 1
    inner = part[1] == 0
    down = np.where(inner, part[0] + made - 1, part[0])
    child[place], child[made:end] = down[0], down[1:]
    count[made:end], axis[made:end] = part[1][1:], part[2][1:]
    parent[made:end] = np.where(part[3][1:] == 0, place, part[3][1:] + made - 1)
    return end


@jit
def split_range(
    boxes: Floats,
    ids: Words,
    lists: Words,
    areas: Floats,
    is_right: Bytes,
    moved: Words,
    moved_boxes: Floats,
    first: int,
    last: int,
    level: int,
    is_sorted: int,
    rules: Rules,
    stop: int,
) -> Part:
    """Splits the slots from `first` to `last` until all nodes are leaves or wait, those of at most `stop`; left first.

    A node that waits is already written as a leaf over its range of slots, so leaves need no further work.
    """
    room = min(2 * (last - first) - 1, ROOM)
    child, count = np.empty(room, np.int32), np.empty(room, np.int32)
    axis, parent = np.empty(room, np.uint8), np.empty(room, np.int32)
    moved, moved_boxes = moved[first:last], moved_boxes[first:last]
    waiting, cells = np.zeros((MAX_DEPTH + 2, 3), np.int64), np.empty((room if stop > 0 else 0, 5), np.int64)
    child[0], count[0], axis[0], parent[0] = first, last - first, 0, -1
    waiting[0, 1], waiting[0, 2] = level, is_sorted
    small = SMALL if rules.exact else BINNED_SMALL
    few = BINNED_FEW if rules.use_sah and not rules.exact else 0
    top, made, cut_off = 1, 1, 0
    while top > 0:
        top -= 1
        node, depth, in_order = waiting[top]
        begin, end = child[node], child[node] + count[node]
        if end - begin <= stop:
            cells[cut_off, 0], cells[cut_off, 1], cells[cut_off, 2] = node, begin, end
            cells[cut_off, 3], cells[cut_off, 4] = depth, in_order
            cut_off += 1
            continue
        if not in_order and (end - begin <= small or depth + 1 + _levels(end - begin - 1) > rules.max_depth):
            sort_range(boxes, lists, begin, end)
            in_order = 1
        if end - begin == 1:
            continue
        chosen, cut = NO_SPLIT, begin + 1
        if not in_order:
            if rules.exact:
                chosen, cut = bounded_split(boxes, ids, moved_boxes, moved, begin, end, rules)
            else:
                chosen, cut = binned_split(boxes, ids, begin, end)
            if chosen == NO_SPLIT:
                sort_range(boxes, lists, begin, end)
                in_order = 1
        elif end - begin == 2 and rules.use_sah and depth < rules.max_depth:
            chosen = pair_split(boxes, lists, begin, rules)
            if chosen == NO_SPLIT:
                continue
        elif end - begin <= few and depth + end - begin - 1 <= rules.max_depth:
            chosen, cut = few_split(boxes, lists, areas, begin, end, rules)
            if chosen == NO_SPLIT:
                continue
        if chosen == NO_SPLIT:
            chosen, cut = _choose(boxes, lists, areas, begin, end, depth, rules)
            if chosen == NO_SPLIT:
                continue
            _partition(lists, is_right, moved, chosen, begin, cut, end)
        if made + 2 > len(child):
            room = 2 * len(child) + 2
            child, count, parent = resized(child, room), resized(count, room), resized(parent, room)
            axis = resized(axis, room)
            cells = resized_rows(cells, room if stop > 0 else 0)
        _make_children(child, count, parent, node, made, begin, cut, end)
        axis[node], axis[made], axis[made + 1] = chosen, 0, 0
        for side in range(2):
            waiting[top, 0], waiting[top, 1], waiting[top, 2] = made + 1 - side, depth + 1, in_order
            top += 1
        made += 2
    nodes = (resized(child, made), resized(count, made), resized(axis, made), resized(parent, made))
    return (*nodes, resized_rows(cells, cut_off))


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
