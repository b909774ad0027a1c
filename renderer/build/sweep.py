"""Where a BVH node is cut: the full SAH sweep over presorted lists, and the median."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Floats = npt.NDArray[np.float32]
Words = npt.NDArray[np.uint32]

NO_SPLIT = -1
MEDIAN_LEAF = 4


class Rules(NamedTuple):
    """What a BVH build goes by, as compiled code takes it; unless `exact`, large nodes are cut between bins."""

    use_sah: bool
    max_depth: int
    traversal: float
    intersection: float
    exact: bool


@jit
def sah_split(boxes: Floats, lists: Words, areas: Floats, begin: int, end: int, rules: Rules) -> tuple[int, int]:
    """The cheapest (axis, first slot of the right child), or NO_SPLIT where a leaf costs no more.

    Minimises area(left) * count(left) + area(right) * count(right) over every cut of the three sorted lists
    (MacDonald and Booth 1990). `areas` is scratch for the right sides.
    """
    best, axis, cut = np.float32(np.inf), NO_SPLIT, begin
    for candidate in range(3):
        first = _right_areas(boxes, lists, areas, candidate, begin, end, best)
        cost, slot = _cheapest_cut(boxes, lists, areas, candidate, begin, end, first, best)
        if cost < best:
            best, axis, cut = cost, candidate, slot
    return (NO_SPLIT, begin) if _leaf_is_cheaper(areas[begin], end - begin, best, rules) else (axis, cut)


@jit
def few_split(boxes: Floats, lists: Words, areas: Floats, begin: int, end: int, rules: Rules) -> tuple[int, int]:
    """`sah_split` along one axis, on which the centroids reach furthest; sorts the first list, and needs no other."""
    axis, best = _widest(boxes, lists, begin, end), np.float32(np.inf)
    for i in range(begin + 1, end):
        box, at = lists[0, i], i
        key = _centroid(boxes, box, axis)
        while at > begin and _centroid(boxes, lists[0, at - 1], axis) > key:
            lists[0, at] = lists[0, at - 1]
            at -= 1
        lists[0, at] = box
    first = _right_areas(boxes, lists, areas, 0, begin, end, best)
    best, cut = _cheapest_cut(boxes, lists, areas, 0, begin, end, first, best)
    return (NO_SPLIT, begin) if _leaf_is_cheaper(areas[begin], end - begin, best, rules) else (axis, cut)


@jit
def _leaf_is_cheaper(area: np.float32, size: int, parts: np.float32, rules: Rules) -> bool:
    """Or as cheap: `parts` is what triangles in both children cost, by area."""
    return bool(size * rules.intersection * area <= rules.traversal * area + rules.intersection * parts)


@jit
def _widest(boxes: Floats, lists: Words, begin: int, end: int) -> int:
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for i in range(begin, end):
        box = lists[0, i]
        x, y, z = _centroid(boxes, box, 0), _centroid(boxes, box, 1), _centroid(boxes, box, 2)
        x0, y0, z0 = min(x, x0), min(y, y0), min(z, z0)
        x1, y1, z1 = max(x, x1), max(y, y1), max(z, z1)
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    return (0 if x >= z else 2) if x >= y else (1 if y >= z else 2)


@jit
def _centroid(boxes: Floats, box: int, axis: int) -> np.float32:
    """Twice of it."""
    return np.float32(boxes[box, axis] + boxes[box, axis + 3])


@jit
def pair_split(boxes: Floats, lists: Words, begin: int, rules: Rules) -> int:
    """`sah_split` of two: the axis along which they are cut, on which they lie farthest apart; sorts the first list."""
    a, b = lists[0, begin], lists[0, begin + 1]
    x = max(boxes[a, 3], boxes[b, 3]) - min(boxes[a, 0], boxes[b, 0])
    y = max(boxes[a, 4], boxes[b, 4]) - min(boxes[a, 1], boxes[b, 1])
    z = max(boxes[a, 5], boxes[b, 5]) - min(boxes[a, 2], boxes[b, 2])
    area, parts = x * y + z * (x + y), _area(boxes, a) + _area(boxes, b)
    if _leaf_is_cheaper(area, 2, parts, rules):
        return NO_SPLIT
    axis, widest = 0, np.float32(-1)
    for k in range(3):
        apart = abs(_centroid(boxes, a, k) - _centroid(boxes, b, k))
        if apart > widest:
            axis, widest = k, apart
    if _centroid(boxes, a, axis) > _centroid(boxes, b, axis):
        lists[0, begin], lists[0, begin + 1] = b, a
    return axis


@jit
def _area(boxes: Floats, i: int) -> np.float32:
    x, y, z = boxes[i, 3] - boxes[i, 0], boxes[i, 4] - boxes[i, 1], boxes[i, 5] - boxes[i, 2]
    return np.float32(x * y + z * (x + y))


@jit
def _right_areas(boxes: Floats, lists: Words, areas: Floats, axis: int, begin: int, end: int, best: np.float32) -> int:
    """Fills areas[i] with the area of [i, end) from the end down, to where that side alone costs `best` or more.

    Returns the first cut whose right side costs less. areas[begin] holds the node's area once an axis ran through.
    """
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for i in range(end - 1, begin - 1, -1):
        box = lists[axis, i]
        x0, y0, z0 = min(boxes[box, 0], x0), min(boxes[box, 1], y0), min(boxes[box, 2], z0)
        x1, y1, z1 = max(boxes[box, 3], x1), max(boxes[box, 4], y1), max(boxes[box, 5], z1)
        x, y, z = x1 - x0, y1 - y0, z1 - z0
        areas[i] = x * y + z * (x + y)
        if areas[i] * np.float32(end - i) >= best:
            return i + 1
    return begin + 1


@jit
def _cheapest_cut(
    boxes: Floats, lists: Words, areas: Floats, axis: int, begin: int, end: int, first: int, best: np.float32
) -> tuple[np.float32, int]:
    """The least cost of a cut in [first, end) below `best` and the cut; sides that alone reach it are passed over."""
    cut = begin
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for i in range(begin + 1, end):
        box = lists[axis, i - 1]
        x0, y0, z0 = min(boxes[box, 0], x0), min(boxes[box, 1], y0), min(boxes[box, 2], z0)
        x1, y1, z1 = max(boxes[box, 3], x1), max(boxes[box, 4], y1), max(boxes[box, 5], z1)
        if i < first:
            continue
        x, y, z = x1 - x0, y1 - y0, z1 - z0
        left = (x * y + z * (x + y)) * np.float32(i - begin)
        if left >= best:
            break
        cost = left + areas[i] * np.float32(end - i)
        if cost < best:
            best, cut = cost, i
    return best, cut


@jit
def median_split(boxes: Floats, lists: Words, begin: int, end: int) -> tuple[int, int]:
    """The middle of the list along the axis on which the centroids reach furthest."""
    axis, widest = 0, np.float32(-1)
    for candidate in range(3):
        first, last = lists[candidate, begin], lists[candidate, end - 1]
        reach = _centroid(boxes, last, candidate) - _centroid(boxes, first, candidate)
        if reach > widest:
            axis, widest = candidate, reach
    return axis, begin + (end - begin) // 2
