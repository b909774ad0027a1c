"""The sorted lists of a node of moderate size: buckets, then an insertion sort of what is nearly in order."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.radix import sort_keys, stable_order
from renderer.build.spatial import LEAST_REACH
from renderer.build.tree import Floats
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

FEW = 24
"""Up to so many are inserted one by one."""

BUCKETS = 2048
"""At most so many, and no more than there are keys."""

STEPS = 8
"""Insertion takes at most so many steps a box, before all are sorted by digits instead."""


@jit
def sort_range(boxes: Floats, lists: Words, begin: int, end: int) -> None:
    """Fills the three lists of a range with its slots in the order of their centroids, stably."""
    size = end - begin
    keys, buckets = np.empty(size, np.float32), np.empty(min(size, BUCKETS) + 1 if size > FEW else 0, np.uint32)
    for axis in range(3):
        for i in range(size):
            keys[i] = boxes[begin + i, axis] + boxes[begin + i, axis + 3]
        own = lists[axis, begin:end]
        if size <= FEW or not _in_buckets(keys, own, buckets):
            for i in range(size):
                own[i] = i
        if not _inserted(keys, own, STEPS * size if size > FEW else size * size):
            order = stable_order(sort_keys(keys))
            for i in range(size):
                own[i] = order[i]
        for i in range(size):
            own[i] += np.uint32(begin)


@jit
def _in_buckets(keys: Floats, own: Words, buckets: Words) -> bool:
    """Puts the places of `keys` into `own` by equal parts of their range; False where that is hardly one point."""
    low, high = keys[0], keys[0]
    for key in keys:
        low, high = min(key, low), max(key, high)
    if not high - low > LEAST_REACH:
        return False
    number = len(buckets) - 1
    scale = np.float32(number) * np.float32(0.9999) / (high - low)
    for b in range(number + 1):
        buckets[b] = 0
    for key in keys:
        buckets[np.uint64(np.uint32((key - low) * scale)) + np.uint64(1)] += np.uint32(1)
    for b in range(number):
        buckets[b + 1] += buckets[b]
    for i in range(len(keys)):
        bucket = np.uint64(np.uint32((keys[i] - low) * scale))
        own[np.uint64(buckets[bucket])] = i
        buckets[bucket] += np.uint32(1)
    return True


@jit
def _inserted(keys: Floats, own: Words, most: int) -> bool:
    """Sorts the places in `own` by their keys, stably, or gives up after `most` steps."""
    steps = 0
    for i in range(1, len(own)):
        one = own[i]
        key, at = keys[one], i
        while at > 0 and keys[own[at - 1]] > key:
            own[at] = own[at - 1]
            at -= 1
        own[at] = one
        steps += i - at
        if steps > most:
            return False
    return True
