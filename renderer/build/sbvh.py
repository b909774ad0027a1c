"""The BVH with spatial splits (Stich, Friedrich and Dietrich 2009), down to single references."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_rows
from renderer.build.loose import Loose
from renderer.build.parallel import each
from renderer.build.progress import TOP_SHARE, Told, within
from renderer.build.radix import stable_order
from renderer.build.spatial_split import BINS, NO_PLANE, best_plane, row_area
from renderer.build.tree import Bytes, Floats, Ints
from renderer.jit import jit

OVERLAP = 1e-4
"""Planes are looked for where the object split's sides overlap by more than this of the root's area (section 4.5)."""

GROWTH = 1.0
"""The most references more than triangles, per triangle; a subtree's share goes by its references."""

TASK = 1 << 15
"""Subtrees of at most so many references are a task of their own."""

SMALL = 1024
"""Fewer references than this are sorted by comparisons."""


class References(NamedTuple):
    """Boxes (r, 6) float32 and the triangles that they are parts of, (r,) int32."""

    box: Floats
    triangle: Ints


class Part(NamedTuple):
    """A subtree that may end in nodes that wait: size 0 and child -1 - w for waiting cell w.

    `cells` (w, 4): first and last reference of each, its depth, and the references that it may still add.
    """

    box: Floats
    child: Ints
    size: Ints
    parent: Ints
    held: References
    cells: npt.NDArray[np.int64]


def split_down(refs: References, max_depth: int, worth: float, told: Told) -> tuple[Loose, References]:
    """The tree of one reference a leaf, and the references in the slots' order.

    A plane is taken where it costs less than `worth` times the best object split.
    """
    root = max(row_area(_around(refs.box), 0), float(np.finfo(np.float64).tiny))
    spare = int(GROWTH * len(refs.triangle))
    first = _split_all(refs, 0, spare, root, max_depth, worth, TASK)
    rows = [tuple(int(value) for value in row) for row in first.cells]
    tasks = [
        partial(_split_all, _rows_of(first.held, begin, end), depth, more, root, max_depth, worth, 0)
        for begin, end, depth, more in rows
    ]
    return _joined(first, each(tasks, within(told, TOP_SHARE, 1.0)))


def _rows_of(held: References, begin: int, end: int) -> References:
    return References(held.box[begin:end], held.triangle[begin:end])


@jit
def _around(box: Floats) -> Floats:
    around = np.empty((1, 6), np.float32)
    for k in range(3):
        around[0, k], around[0, k + 3] = np.float32(np.inf), np.float32(-np.inf)
        for i in range(len(box)):
            around[0, k] = min(around[0, k], box[i, k])
            around[0, k + 3] = max(around[0, k + 3], box[i, k + 3])
    return around


def _joined(first: Part, parts: list[Part]) -> tuple[Loose, References]:
    """One tree of a part and those of its waiting cells; what the first part holds for these is in no leaf."""
    box, held = [first.box], [first.held]
    child, size, parent = [first.child], [first.size], [first.parent]
    nodes, slots = len(first.child), len(first.held.triangle)
    for place, part in zip(np.flatnonzero(first.child < 0), sorted_parts(first, parts), strict=True):
        down, inner, leaf = part.child.copy(), part.size == 0, part.size > 0
        down[inner] += nodes - 1
        down[leaf] += slots
        above = part.parent + nodes - 1
        above[part.parent == 0] = place
        first.box[place], first.child[place], first.size[place] = part.box[0], down[0], part.size[0]
        box.append(part.box[1:])
        child.append(down[1:])
        size.append(part.size[1:])
        parent.append(above[1:])
        held.append(part.held)
        nodes, slots = nodes + len(part.child) - 1, slots + len(part.held.triangle)
    joined = References(np.concatenate([one.box for one in held]), np.concatenate([one.triangle for one in held]))
    tree = Loose(np.concatenate(box), np.concatenate(child), np.concatenate(size), np.concatenate(parent))
    return tree, joined


def sorted_parts(first: Part, parts: list[Part]) -> list[Part]:
    """The parts in the order of the nodes that wait for them."""
    return [parts[-1 - child] for child in first.child[first.child < 0]]


@jit
def _split_all(refs: References, depth: int, spare: int, root: float, max_depth: int, worth: float, stop: int) -> Part:
    """Splits depth first, left before right; the references of the cells that wait lie on one another."""
    size = len(refs.triangle)
    stack = References(refs.box.copy(), refs.triangle.copy())
    out = References(np.empty((size, 6), np.float32), np.empty(size, np.int32))
    box, child = np.empty((2 * size + 1, 6), np.float32), np.empty(2 * size + 1, np.int32)
    count, parent = np.empty(2 * size + 1, np.int32), np.empty(2 * size + 1, np.int32)
    waiting, cells = np.zeros((max_depth + 3, 5), np.int64), np.empty((64, 4), np.int64)
    bins, ends = np.empty((2 * BINS, 6), np.float32), np.empty((2, BINS), np.int64)
    waiting[0, 1], waiting[0, 3], waiting[0, 4] = size, depth, spare
    parent[0], top, made, filled, cut_off = -1, 1, 1, 0, 0
    while top > 0:
        top -= 1
        begin, end, node, level, more = waiting[top]
        own = stack.box[begin:end]
        around = _around(own)
        for k in range(6):
            box[node, k] = around[0, k]
        if end - begin == 1 or end - begin <= stop:
            out = _with_room(out, filled + end - begin)
            for i in range(begin, end):
                _put(out, filled + i - begin, stack, i)
            child[node], count[node] = filled, end - begin
            if stop > 0:
                if cut_off == len(cells):
                    cells = _more_cells(cells)
                cells[cut_off, 0], cells[cut_off, 1] = filled, filled + end - begin
                cells[cut_off, 2], cells[cut_off, 3] = level, more
                child[node], count[node] = -1 - cut_off, 0
                cut_off += 1
            filled += end - begin
            continue
        parts, axis, plane = _choose(own, row_area(around, 0), root, level, max_depth, worth, more, bins, ends)
        right, left = _divided(_slice(stack, begin, end), parts, axis, plane)
        middle, after = begin + len(right.triangle), begin + len(right.triangle) + len(left.triangle)
        stack = _with_room(stack, after)
        for i in range(middle - begin):
            _put(stack, begin + i, right, i)
        for i in range(after - middle):
            _put(stack, middle + i, left, i)
        if made + 2 > len(child):
            box, child = resized_rows(box, 2 * made), resized(child, 2 * made)
            count, parent = resized(count, 2 * made), resized(parent, 2 * made)
        child[node], count[node], parent[made], parent[made + 1] = made, 0, node, node
        rest = more - (after - end)
        of_left = rest * (after - middle) // (after - begin)
        _wait(waiting, top, begin, middle, made + 1, level + 1, rest - of_left)
        _wait(waiting, top + 1, middle, after, made, level + 1, of_left)
        top += 2
        made += 2
    held = References(resized_rows(out.box, filled), resized(out.triangle, filled))
    return Part(
        resized_rows(box, made),
        resized(child, made),
        resized(count, made),
        resized(parent, made),
        held,
        cells[:cut_off].copy(),
    )


@jit
def _wait(waiting: npt.NDArray[np.int64], at: int, begin: int, end: int, node: int, level: int, more: int) -> None:
    waiting[at, 0], waiting[at, 1], waiting[at, 2], waiting[at, 3], waiting[at, 4] = begin, end, node, level, more


@jit
def _more_cells(cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    more = np.empty((2 * len(cells), 4), np.int64)
    for i in range(len(cells)):
        for j in range(4):
            more[i, j] = cells[i, j]
    return more


@jit
def _slice(refs: References, begin: int, end: int) -> References:
    return References(refs.box[begin:end], refs.triangle[begin:end])


@jit
def _with_room(refs: References, room: int) -> References:
    if room <= len(refs.triangle):
        return refs
    return References(resized_rows(refs.box, 2 * room), resized(refs.triangle, 2 * room))


@jit
def _put(target: References, at: int, source: References, i: int) -> None:
    for k in range(6):
        target.box[at, k] = source.box[i, k]
    target.triangle[at] = source.triangle[i]


@jit
def _choose(
    own: Floats,
    area: float,
    root: float,
    level: int,
    max_depth: int,
    worth: float,
    more: int,
    bins: Floats,
    ends: npt.NDArray[np.int64],
) -> tuple[Bytes, int, np.float32]:
    """How the references (n, 6) are divided: by a plane, or, where the axis is NO_PLANE, each to a side: 1 is right."""
    size = len(own)
    levels = 0
    while (1 << levels) < size - 1:
        levels += 1
    side: Bytes = np.zeros(size, np.uint8)
    if level + 1 + levels > max_depth:
        _halve(own, side)
        return side, NO_PLANE, np.float32(0)
    cost, overlap = _object_split(own, side)
    if overlap > OVERLAP * root:
        _, axis, plane = best_plane(own, worth * cost, bins, ends)
        if axis != NO_PLANE:
            crossing = 0
            for i in range(size):
                crossing += int(own[i, axis] < plane and own[i, axis + 3] > plane)
            if crossing <= more:
                return side, axis, plane
    if not cost < size * area:
        _halve(own, side)
    return side, NO_PLANE, np.float32(0)


@jit
def _sorted(own: Floats, axis: int) -> npt.NDArray[np.int64]:
    """The references along an axis by their centres; of equal ones the first comes first."""
    centre = np.empty(len(own), np.float32)
    for i in range(len(own)):
        centre[i] = own[i, axis] * np.float32(0.5) + own[i, axis + 3] * np.float32(0.5)
    if len(own) < SMALL:
        return np.argsort(centre, kind="mergesort")
    bits = centre.view(np.uint32)
    keys = np.empty(len(own), np.uint32)
    for i in range(len(own)):
        sign = np.uint32(0xFFFFFFFF) if bits[i] >> np.uint32(31) else np.uint32(0x80000000)
        keys[i] = bits[i] ^ sign
    return stable_order(keys).astype(np.int64)


@jit
def _object_split(own: Floats, side: Bytes) -> tuple[float, float]:
    """Sets `side` by the cheapest cut of the three orders; returns its cost and how much its sides overlap."""
    size = len(own)
    best, overlap = np.inf, 0.0
    areas = np.empty(size, np.float64)
    run = np.empty((size, 6), np.float32)
    grown = np.empty((1, 6), np.float32)
    for axis in range(3):
        order = _sorted(own, axis)
        for i in range(size - 1, -1, -1):
            for k in range(6):
                run[i, k] = own[order[i], k]
            if i + 1 < size:
                for k in range(3):
                    run[i, k] = min(run[i, k], run[i + 1, k])
                    run[i, k + 3] = max(run[i, k + 3], run[i + 1, k + 3])
            areas[i] = row_area(run, i)
        cut = 0
        for k in range(6):
            grown[0, k] = own[order[0], k]
        for i in range(1, size):
            cost = row_area(grown, 0) * i + areas[i] * (size - i)
            if cost < best:
                best, cut = cost, i
                overlap = _common(grown, run, i)
            for k in range(3):
                grown[0, k] = min(grown[0, k], own[order[i], k])
                grown[0, k + 3] = max(grown[0, k + 3], own[order[i], k + 3])
        if cut > 0:
            for i in range(size):
                side[order[i]] = i >= cut
    return best, overlap


@jit
def _common(a: Floats, b: Floats, i: int) -> float:
    """Half the surface of what the first of `a` and `b[i]` have in common."""
    x = np.float64(min(a[0, 3], b[i, 3])) - np.float64(max(a[0, 0], b[i, 0]))
    y = np.float64(min(a[0, 4], b[i, 4])) - np.float64(max(a[0, 1], b[i, 1]))
    z = np.float64(min(a[0, 5], b[i, 5])) - np.float64(max(a[0, 2], b[i, 2]))
    return x * y + z * (x + y) if min(x, min(y, z)) >= 0.0 else 0.0


@jit
def _halve(own: Floats, side: Bytes) -> None:
    """The median of the longest axis."""
    around = _around(own)
    axis = 0
    for k in range(1, 3):
        if around[0, k + 3] - around[0, k] > around[0, axis + 3] - around[0, axis]:
            axis = k
    order = _sorted(own, axis)
    for i in range(len(own)):
        side[order[i]] = i >= len(own) // 2


@jit
def _divided(own: References, side: Bytes, axis: int, plane: np.float32) -> tuple[References, References]:
    """What goes right and what goes left; of a reference that the plane crosses, each side its part of the box."""
    size = len(own.triangle)
    left, right = 0, 0
    for i in range(size):
        if axis == NO_PLANE:
            right += side[i]
            left += 1 - side[i]
        else:
            right += int(own.box[i, axis] >= plane or own.box[i, axis + 3] > plane)
            left += int(own.box[i, axis] < plane)
    rights = References(np.empty((right, 6), np.float32), np.empty(right, np.int32))
    lefts = References(np.empty((left, 6), np.float32), np.empty(left, np.int32))
    left, right = 0, 0
    for i in range(size):
        if axis == NO_PLANE:
            to_right, to_left = side[i] == 1, side[i] == 0
        else:
            to_right = own.box[i, axis] >= plane or own.box[i, axis + 3] > plane
            to_left = own.box[i, axis] < plane
        if to_right:
            _put(rights, right, own, i)
            right += 1
        if to_left:
            _put(lefts, left, own, i)
            left += 1
        if to_right and to_left:
            rights.box[right - 1, axis], lefts.box[left - 1, axis + 3] = plane, plane
    return rights, lefts
