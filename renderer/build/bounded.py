"""Cuts of large nodes, which need no sorted lists: bins along all axes tell where the cheapest one lies (Wald 2007).

What lies left of a bin and what lies right of it bound from below what a cut within the bin costs, and the cheapest
border between bins bounds the cheapest cut from above. So only the few bins whose bound is lower than that are sorted
and swept, and the cut is the full sweep's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.radix import sort_keys, stable_order
from renderer.build.spatial import LEAST_REACH
from renderer.build.sweep import NO_SPLIT, Rules
from renderer.build.tree import Floats
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
Longs = npt.NDArray[np.int64]

BINS = 128

FEW = 512
"""Up to so many are sorted by comparisons."""

INF = np.float32(np.inf)


class Bins(NamedTuple):
    """Bins along three axes: number b along axis a holds (twice a centroid - low[a]) * scale[a] = b and a fraction.

    `left`, `right` (3, BINS + 1, 6) float32: the boxes around the bins below b, and around b and those above;
    `left_area`, `right_area`: theirs, 0 where empty; `before` (3, BINS + 1) int64: how many lie in the bins below b.
    """

    low: Floats
    scale: Floats
    left: Floats
    right: Floats
    left_area: Floats
    right_area: Floats
    before: Longs


class Cut(NamedTuple):
    """Left are the bins below `border`, and of that one what has a key below `key`, or equal to it and is among the
    first `equals` of these; a key is twice a centroid. `left` says how many that makes."""

    cost: np.float32
    axis: int
    border: int
    key: np.float32
    equals: int
    left: int


@jit
def bounded_split(
    boxes: Floats, ids: Words, moved: Floats, moved_ids: Words, begin: int, end: int, rules: Rules
) -> tuple[int, int]:
    """The axis and the first slot right of the cheapest cut.

    Moves `boxes` and `ids`, stably, to the side on which they lie; `moved` (n, 6) and `moved_ids` (n,) are scratch.
    NO_SPLIT where a leaf costs no more, or where all centroids are nearly one point.
    """
    size, bins = end - begin, _binned(boxes, begin, end)
    cut = _cheapest_border(bins, size)
    if cut.axis == NO_SPLIT:
        return NO_SPLIT, begin
    cut = _within_bins(boxes, begin, end, bins, cut)
    whole = bins.right_area[cut.axis, 0]
    if size * rules.intersection * whole <= rules.traversal * whole + rules.intersection * cut.cost:
        return NO_SPLIT, begin
    _divide(boxes, ids, moved, moved_ids, begin, end, bins, cut)
    return cut.axis, begin + cut.left


@jit
def _binned(boxes: Floats, begin: int, end: int) -> Bins:
    low, scale = _grid(boxes, begin, end)
    bins, counts = _filled(boxes, begin, end, low, scale)
    left, right = np.empty((3, BINS + 1, 6), np.float32), np.empty((3, BINS + 1, 6), np.float32)
    left_area, right_area = np.zeros((3, BINS + 1), np.float32), np.zeros((3, BINS + 1), np.float32)
    before = np.zeros((3, BINS + 1), np.int64)
    for axis in range(3):
        for k in range(3):
            left[axis, 0, k], left[axis, 0, k + 3] = INF, -INF
            right[axis, BINS, k], right[axis, BINS, k + 3] = INF, -INF
        for b in range(BINS):
            before[axis, b + 1] = before[axis, b] + counts[axis, b]
            left_area[axis, b + 1] = _around_two(left[axis], b, bins[axis], b, left[axis], b + 1)
        for b in range(BINS - 1, -1, -1):
            right_area[axis, b] = _around_two(right[axis], b + 1, bins[axis], b, right[axis], b)
    return Bins(low, scale, left, right, left_area, right_area, before)


@jit
def _grid(boxes: Floats, begin: int, end: int) -> tuple[Floats, Floats]:
    """Where twice the centroids begin along each axis, and bins a length; 0 where they hardly differ."""
    x0, y0, z0 = INF, INF, INF
    x1, y1, z1 = -INF, -INF, -INF
    for i in range(begin, end):
        x, y, z = boxes[i, 0] + boxes[i, 3], boxes[i, 1] + boxes[i, 4], boxes[i, 2] + boxes[i, 5]
        x0, y0, z0 = min(x, x0), min(y, y0), min(z, z0)
        x1, y1, z1 = max(x, x1), max(y, y1), max(z, z1)
    low, reach = np.empty(3, np.float32), np.empty(3, np.float32)
    low[0], low[1], low[2] = x0, y0, z0
    reach[0], reach[1], reach[2] = x1 - x0, y1 - y0, z1 - z0
    scale = np.zeros(3, np.float32)
    for axis in range(3):
        if reach[axis] >= LEAST_REACH:
            scale[axis] = np.float32(BINS) * np.float32(0.9999) / reach[axis]
    return low, scale


@jit
def _filled(boxes: Floats, begin: int, end: int, low: Floats, scale: Floats) -> tuple[Floats, Longs]:
    """The box of what each bin holds, and how many."""
    bins, counts = np.empty((3, BINS, 6), np.float32), np.zeros((3, BINS), np.int64)
    for axis in range(3):
        for b in range(BINS):
            for k in range(3):
                bins[axis, b, k], bins[axis, b, k + 3] = INF, -INF
    for i in range(begin, end):
        x0, y0, z0 = boxes[i, 0], boxes[i, 1], boxes[i, 2]
        x1, y1, z1 = boxes[i, 3], boxes[i, 4], boxes[i, 5]
        for axis in range(3):
            place = np.uint64(np.uint32((boxes[i, axis] + boxes[i, axis + 3] - low[axis]) * scale[axis]))
            counts[axis, place] += 1
            bins[axis, place, 0], bins[axis, place, 3] = min(x0, bins[axis, place, 0]), max(x1, bins[axis, place, 3])
            bins[axis, place, 1], bins[axis, place, 4] = min(y0, bins[axis, place, 1]), max(y1, bins[axis, place, 4])
            bins[axis, place, 2], bins[axis, place, 5] = min(z0, bins[axis, place, 2]), max(z1, bins[axis, place, 5])
    return bins, counts


@jit
def _around_two(a: Floats, i: int, b: Floats, j: int, to: Floats, k: int) -> np.float32:
    """Puts the box around a[i] and b[j] at to[k]; returns half its surface, 0 where it is empty."""
    x0, y0, z0 = min(a[i, 0], b[j, 0]), min(a[i, 1], b[j, 1]), min(a[i, 2], b[j, 2])
    x1, y1, z1 = max(a[i, 3], b[j, 3]), max(a[i, 4], b[j, 4]), max(a[i, 5], b[j, 5])
    to[k, 0], to[k, 1], to[k, 2], to[k, 3], to[k, 4], to[k, 5] = x0, y0, z0, x1, y1, z1
    x, y, z = x1 - x0, y1 - y0, z1 - z0
    return x * y + z * (x + y) if x >= 0 else np.float32(0)


@jit
def _cheapest_border(bins: Bins, size: int) -> Cut:
    cost, axis, border = INF, NO_SPLIT, 0
    for candidate in range(3):
        for b in range(1, BINS):
            left = bins.before[candidate, b]
            if 0 < left < size and left < bins.before[candidate, b + 1]:
                here = bins.left_area[candidate, b] * np.float32(left)
                here += bins.right_area[candidate, b] * np.float32(size - left)
                if here < cost:
                    cost, axis, border = here, candidate, b
    return Cut(cost, axis, border, -INF, 0, bins.before[axis, border])


@jit
def _within_bins(boxes: Floats, begin: int, end: int, bins: Bins, cut: Cut) -> Cut:
    """`cut`, or a cheaper one within a bin."""
    first, members, bounds = _members(boxes, begin, end, bins, cut.cost)
    for place in np.argsort(bounds, kind="mergesort"):
        if not bounds[place] < cut.cost:
            break
        cut = _swept(
            boxes, members[first[place] : first[place + 1]], place // BINS, place % BINS, end - begin, bins, cut
        )
    return cut


@jit
def _members(boxes: Floats, begin: int, end: int, bins: Bins, most: np.float32) -> tuple[Longs, Longs, Floats]:
    """The boxes in bins within which a cut may cost less than `most`, from `first` of each bin on, and those bounds."""
    size = end - begin
    first, bounds = np.zeros(3 * BINS + 1, np.int64), np.full(3 * BINS, INF)
    for axis in range(3):
        for b in range(BINS):
            left, here = bins.before[axis, b], bins.before[axis, b + 1] - bins.before[axis, b]
            if here > 1:
                bound = bins.left_area[axis, b] * np.float32(left + 1)
                bound += bins.right_area[axis, b + 1] * np.float32(size - left - here + 1)
                if bound < most:
                    bounds[axis * BINS + b] = bound
                    first[axis * BINS + b + 1] = here
    for place in range(3 * BINS):
        first[place + 1] += first[place]
    to, members = first.copy(), np.empty(first[3 * BINS], np.int64)
    for axis in range(3):
        if first[(axis + 1) * BINS] == first[axis * BINS]:
            continue
        for i in range(begin, end):
            place = axis * BINS + _bin_of(boxes, i, axis, bins)
            if bounds[place] < INF:
                members[to[place]] = i
                to[place] += 1
    return first, members, bounds


@jit
def _bin_of(boxes: Floats, i: int, axis: int, bins: Bins) -> int:
    return int(np.uint32((boxes[i, axis] + boxes[i, axis + 3] - bins.low[axis]) * bins.scale[axis]))


@jit
def _swept(boxes: Floats, members: Longs, axis: int, b: int, size: int, bins: Bins, cut: Cut) -> Cut:
    """`cut`, or a cheaper one within bin b along an axis, which has `members`."""
    here, before = len(members), bins.before[axis, b]
    keys = np.empty(here, np.float32)
    for j in range(here):
        keys[j] = boxes[members[j], axis] + boxes[members[j], axis + 3]
    order = _order_of(keys)
    areas, run = np.empty(here, np.float32), np.empty((2, 6), np.float32)
    for k in range(6):
        run[0, k], run[1, k] = bins.right[axis, b + 1, k], bins.left[axis, b, k]
    for j in range(here - 1, 0, -1):
        areas[j] = _around_two(run, 0, boxes, members[order[j]], run, 0)
    cost, at = cut.cost, 0
    for j in range(1, here):
        price = _around_two(run, 1, boxes, members[order[j - 1]], run, 1) * np.float32(before + j)
        price += areas[j] * np.float32(size - before - j)
        if price < cost:
            cost, at = price, j
    if at == 0:
        return cut
    key, equals = keys[order[at - 1]], 1
    while equals < at and keys[order[at - 1 - equals]] == key:
        equals += 1
    return Cut(cost, axis, b, key, equals, before + at)


@jit
def _order_of(keys: Floats) -> Longs:
    """Stably sorts; -0 and 0 are equal."""
    if len(keys) <= FEW:
        return np.argsort(keys, kind="mergesort")
    return stable_order(sort_keys(keys)).astype(np.int64)


@jit
def _divide(
    boxes: Floats, ids: Words, moved: Floats, moved_ids: Words, begin: int, end: int, bins: Bins, cut: Cut
) -> None:
    """Written without branches: each box goes to both sides, and only the side that keeps it moves on."""
    left, right, equal, axis = begin, 0, 0, cut.axis
    for i in range(begin, end):
        key, b, own = boxes[i, axis] + boxes[i, axis + 3], _bin_of(boxes, i, axis, bins), ids[i]
        same = int(b == cut.border) & int(key == cut.key)
        stays = int(b < cut.border) | (int(b == cut.border) & int(key < cut.key)) | (same & int(equal < cut.equals))
        equal += same
        for k in range(6):
            moved[right, k] = boxes[i, k]
        for k in range(6):
            boxes[left, k] = moved[right, k]
        ids[left], moved_ids[right] = own, own
        left += stays
        right += 1 - stays
    for i in range(right):
        for k in range(6):
            boxes[left + i, k] = moved[i, k]
        ids[left + i] = moved_ids[i]
