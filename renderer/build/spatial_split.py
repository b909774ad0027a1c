"""Where a plane cuts a BVH node's references in space (Stich, Friedrich and Dietrich 2009), by their boxes alone.

The box of a reference that the plane crosses is cut in two, and not made tighter around what is left of its triangle:
together the boxes of a triangle's references are its own box (ARCHITECTURE.md, Why no traversal loses a hit).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Floats
from renderer.jit import jit

BINS = 64
NO_PLANE = -1

Split = tuple[float, int, np.float32]


@jit
def best_plane(boxes: Floats, bound: float, scratch: Floats, entering: npt.NDArray[np.int64]) -> Split:
    """(cost, axis, plane) of the cheapest of the bins' borders, or axis NO_PLANE if none costs less than `bound`.

    `boxes` (n, 6): the references'. Cost is area times number, summed over both sides. Scratch: `scratch` (2 BINS, 6)
    and `entering` (2, BINS).
    """
    best, axis, plane = bound, NO_PLANE, np.float32(0)
    for candidate in range(3):
        low, high = np.float32(np.inf), np.float32(-np.inf)
        for i in range(len(boxes)):
            low, high = min(low, boxes[i, candidate]), max(high, boxes[i, candidate + 3])
        if not low < _border(low, high, 1) < _border(low, high, BINS - 1) < high:
            continue
        cost, where = _best_border(boxes, candidate, low, high, best, scratch, entering)
        if cost < best:
            best, axis, plane = cost, candidate, where
    return best, axis, plane


@jit
def _border(low: np.float32, high: np.float32, at: int) -> np.float32:
    return np.float32(np.float64(low) + (np.float64(high) - np.float64(low)) * (at / BINS))


@jit
def _bin_of(x: np.float32, low: np.float32, high: np.float32) -> int:
    """The last bin whose lower border is at most x."""
    share = (np.float64(x) - np.float64(low)) / (np.float64(high) - np.float64(low))
    at = min(BINS - 1, max(0, int(share * BINS)))
    while at > 0 and _border(low, high, at) > x:
        at -= 1
    while at < BINS - 1 and _border(low, high, at + 1) <= x:
        at += 1
    return at


@jit
def _fill(
    boxes: Floats, axis: int, low: np.float32, high: np.float32, bins: Floats, ends: npt.NDArray[np.int64]
) -> None:
    """Each bin's bounds of what of the references lies in it, and how many begin and end there."""
    for b in range(BINS):
        ends[0, b], ends[1, b] = 0, 0
        for k in range(3):
            bins[b, k], bins[b, k + 3] = np.float32(np.inf), np.float32(-np.inf)
    for i in range(len(boxes)):
        first = _bin_of(boxes[i, axis], low, high)
        last = first
        while last < BINS - 1 and _border(low, high, last + 1) < boxes[i, axis + 3]:
            last += 1
        ends[0, first] += 1
        ends[1, last] += 1
        for b in range(first, last + 1):
            for k in range(3):
                lower, upper = boxes[i, k], boxes[i, k + 3]
                if k == axis and b > first:
                    lower = _border(low, high, b)
                if k == axis and b < last:
                    upper = _border(low, high, b + 1)
                bins[b, k], bins[b, k + 3] = min(bins[b, k], lower), max(bins[b, k + 3], upper)


@jit
def _best_border(
    boxes: Floats,
    axis: int,
    low: np.float32,
    high: np.float32,
    bound: float,
    scratch: Floats,
    ends: npt.NDArray[np.int64],
) -> tuple[float, np.float32]:
    bins, right = scratch[:BINS], scratch[BINS:]
    _fill(boxes, axis, low, high, bins, ends)
    for k in range(3):
        right[BINS - 1, k], right[BINS - 1, k + 3] = bins[BINS - 1, k], bins[BINS - 1, k + 3]
    for b in range(BINS - 2, -1, -1):
        for k in range(3):
            right[b, k] = min(bins[b, k], right[b + 1, k])
            right[b, k + 3] = max(bins[b, k + 3], right[b + 1, k + 3])
    best, plane = bound, np.float32(0)
    left_count, right_count = 0, len(boxes)
    for b in range(1, BINS):
        if b > 1:
            for k in range(3):
                bins[0, k] = min(bins[0, k], bins[b - 1, k])
                bins[0, k + 3] = max(bins[0, k + 3], bins[b - 1, k + 3])
        left_count += ends[0, b - 1]
        right_count -= ends[1, b - 1]
        if left_count == 0 or right_count == 0:
            continue
        cost = left_count * row_area(bins, 0) + right_count * row_area(right, b)
        if cost < best and max(left_count, right_count) < len(boxes):
            best, plane = cost, _border(low, high, b)
    return best, plane


@jit
def row_area(boxes: Floats, row: int) -> float:
    """Half the surface of one of `boxes` (n, 6); 0 for one that holds nothing."""
    x = np.float64(boxes[row, 3]) - np.float64(boxes[row, 0])
    y = np.float64(boxes[row, 4]) - np.float64(boxes[row, 1])
    z = np.float64(boxes[row, 5]) - np.float64(boxes[row, 2])
    return x * y + z * (x + y) if x >= 0.0 else 0.0
