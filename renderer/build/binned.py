"""Cuts between bins along one axis, which cost least to find (Wald 2007)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.spatial import LEAST_REACH
from renderer.build.sweep import NO_SPLIT
from renderer.build.tree import Floats
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

BINS = 64


@jit
def binned_split(boxes: Floats, ids: Words, begin: int, end: int) -> tuple[int, int]:
    """The axis along which the centroids reach furthest, and the first slot right of the cheapest border between bins.

    Sorts `boxes` and `ids` by the side of it on which they lie. NO_SPLIT where all centroids are nearly one point.
    """
    axis, low, reach = _longest(boxes, begin, end)
    if reach < LEAST_REACH:
        return NO_SPLIT, begin
    scale = np.float32(BINS) * np.float32(0.9999) / reach
    counts, bins = np.zeros(BINS, np.int64), np.empty((BINS, 6), np.float32)
    for b in range(BINS):
        for k in range(3):
            bins[b, k], bins[b, k + 3] = np.float32(np.inf), np.float32(-np.inf)
    for i in range(begin, end):
        b = int((boxes[i, axis] + boxes[i, axis + 3] - low) * scale)
        counts[b] += 1
        bins[b, 0], bins[b, 3] = min(boxes[i, 0], bins[b, 0]), max(boxes[i, 3], bins[b, 3])
        bins[b, 1], bins[b, 4] = min(boxes[i, 1], bins[b, 1]), max(boxes[i, 4], bins[b, 4])
        bins[b, 2], bins[b, 5] = min(boxes[i, 2], bins[b, 2]), max(boxes[i, 5], bins[b, 5])
    border = _cheapest_border(bins, counts, end - begin)
    left, right = begin, end
    while left < right:
        if int((boxes[left, axis] + boxes[left, axis + 3] - low) * scale) < border:
            left += 1
            continue
        right -= 1
        ids[left], ids[right] = ids[right], ids[left]
        for k in range(6):
            boxes[left, k], boxes[right, k] = boxes[right, k], boxes[left, k]
    return axis, left


@jit
def _longest(boxes: Floats, begin: int, end: int) -> tuple[int, np.float32, np.float32]:
    """The axis, where twice the centroids begin along it, and how far they reach."""
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for i in range(begin, end):
        x, y, z = boxes[i, 0] + boxes[i, 3], boxes[i, 1] + boxes[i, 4], boxes[i, 2] + boxes[i, 5]
        x0, y0, z0 = min(x, x0), min(y, y0), min(z, z0)
        x1, y1, z1 = max(x, x1), max(y, y1), max(z, z1)
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    if x >= y and x >= z:
        return 0, x0, x
    return (1, y0, y) if y >= z else (2, z0, z)


@jit
def _cheapest_border(bins: Floats, counts: npt.NDArray[np.int64], size: int) -> int:
    """The bin that the right side begins with: area times number, summed over both sides, is least there."""
    rights = np.empty(BINS, np.float32)
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for b in range(BINS - 1, 0, -1):
        x0, y0, z0 = min(bins[b, 0], x0), min(bins[b, 1], y0), min(bins[b, 2], z0)
        x1, y1, z1 = max(bins[b, 3], x1), max(bins[b, 4], y1), max(bins[b, 5], z1)
        rights[b] = (x1 - x0) * (y1 - y0) + (z1 - z0) * ((x1 - x0) + (y1 - y0))
    best, border, left = np.float32(np.inf), 1, 0
    x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
    x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
    for b in range(1, BINS):
        left += counts[b - 1]
        x0, y0, z0 = min(bins[b - 1, 0], x0), min(bins[b - 1, 1], y0), min(bins[b - 1, 2], z0)
        x1, y1, z1 = max(bins[b - 1, 3], x1), max(bins[b - 1, 4], y1), max(bins[b - 1, 5], z1)
        area = (x1 - x0) * (y1 - y0) + (z1 - z0) * ((x1 - x0) + (y1 - y0))
        cost = area * np.float32(left) + rights[b] * np.float32(size - left)
        if counts[b] > 0 and left < size and cost < best:
            best, border = cost, b
    return border
