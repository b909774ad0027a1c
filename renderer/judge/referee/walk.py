"""The walk over a BVH, in float64, that loses no exact hit.

Why none is lost. A hit's point p = o + t d lies in its triangle, so in every box above it, whose float32 sides are
exact: (lower_k - o_k) / d_k <= t <= (upper_k - o_k) / d_k for every axis that the ray moves along (sides swapped where
d_k < 0), and lower_k <= o_k <= upper_k for the others, whose sign no rounding changes. Each quotient costs two
roundings of 2^-53, and SLACK widens it by far more. So a box's `near` is at most t, and `far` at least t. A box is left
out only where near > far, near > limit or near > best: t is then beyond its limit, or beyond the best hit, whose t is
known to COARSE and is therefore taken at its upper end. Ties stay in, and go to the smaller triangle.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from renderer.jit import inline, jit
from renderer.judge.referee.bound import measure
from renderer.judge.referee.decide import COARSE, FINE, Tally, crosses, order, time_of, within
from renderer.judge.referee.vectors import Vector, corners
from renderer.records import Floats, Ints

Doubles = npt.NDArray[np.float64]
Nodes = tuple[Floats, Floats, Ints, Ints, Ints]
Best = tuple[float, int]

_SLACK = 1e-12
"""Relative widening of a slab's entry and exit."""

_GROWN_PAD = 64 * 2.0**-24
"""How far boxes grow, relative to their distance, when triangles are grown by the bound."""


@jit
def cast_all(
    triangles: Floats,
    nodes: Nodes,
    room: int,
    origin: Doubles,
    direction: Doubles,
    limit: Doubles,
    grow: float,
    test: int,
    first: bool,
    t: Doubles,
    primitive: Ints,
    tally: Tally,
) -> None:
    """Fill `t` and `primitive` with the closest hit, or with any where `first` is set, of every finite ray."""
    stack, entries = np.empty(room, np.int32), np.empty(room)
    for r in range(len(origin)):
        o = (origin[r, 0], origin[r, 1], origin[r, 2])
        d = (direction[r, 0], direction[r, 1], direction[r, 2])
        if not math.isfinite(o[0] + o[1] + o[2] + d[0] + d[1] + d[2]) or np.isnan(limit[r]):
            continue
        found = _walk(triangles, nodes, stack, entries, o, d, limit[r], grow, test, first, tally)
        t[r], primitive[r] = found
        if found[1] >= 0 and not first:
            t[r] = time_of(corners(triangles, found[1]), o, d, FINE, tally)


@jit
def figures_all(
    triangles: Floats, origin: Doubles, direction: Doubles, primitive: Ints, test: int, out: Doubles
) -> None:
    """Fill `out` (3, n) with each ray's plane t, its float32 bound, and the edge margin."""
    tally = np.zeros(3, np.int64)
    for r in range(len(origin)):
        if primitive[r] >= 0:
            o = (origin[r, 0], origin[r, 1], origin[r, 2])
            d = (direction[r, 0], direction[r, 1], direction[r, 2])
            own = corners(triangles, primitive[r])
            _, out[1, r], out[2, r] = measure(own, o, d, test)
            out[0, r] = time_of(own, o, d, FINE, tally)


@jit
def _walk(
    triangles: Floats,
    nodes: Nodes,
    stack: Ints,
    entries: Doubles,
    o: Vector,
    d: Vector,
    limit: float,
    grow: float,
    test: int,
    first: bool,
    tally: Tally,
) -> Best:
    """The closest hit of one ray, or any hit when `first` is set; t is known to COARSE."""
    lower, upper, child, count, order_ = nodes
    pad = _GROWN_PAD if grow > 0.0 else 0.0
    reach = np.inf if grow > 0.0 else limit  # a grown triangle may count from beyond the limit
    best = (np.inf, -1)
    stack[0], entries[0], top = 0, _node_entry(lower, upper, 0, o, d, reach, pad), 1
    while top > 0:
        top -= 1
        node = stack[top]
        end = min(reach, best[0] * (1.0 + 4.0 * COARSE))
        if entries[top] == np.inf or entries[top] > end:
            continue
        if count[node] > 0:
            slots = order_[child[node] : child[node] + count[node]]
            best = _leaf(triangles, slots, o, d, limit, grow, test, best, tally)
            if first and best[1] >= 0:
                return best
            continue
        left = child[node]
        near = _node_entry(lower, upper, left, o, d, end, pad)
        far = _node_entry(lower, upper, left + 1, o, d, end, pad)
        swap = near > far
        stack[top], entries[top] = (left, near) if swap else (left + 1, far)
        stack[top + 1], entries[top + 1] = (left + 1, far) if swap else (left, near)
        top += 2
    return best


@jit
def _leaf(
    triangles: Floats,
    slots: Ints,
    o: Vector,
    d: Vector,
    limit: float,
    grow: float,
    test: int,
    best: Best,
    tally: Tally,
) -> Best:
    """The better of `best` (t, primitive) and the triangles that a leaf holds."""
    for slot in range(len(slots)):
        i = slots[slot]
        if grow != 0.0:
            if _grown(triangles, i, o, d, limit, grow, test):
                return 0.0, i
        else:
            best = _better(triangles, i, o, d, limit, best, tally)
    return best


@jit
def _better(triangles: Floats, i: int, o: Vector, d: Vector, limit: float, best: Best, tally: Tally) -> Best:
    """The better of `best` and triangle i."""
    own = corners(triangles, i)
    if not crosses(own, o, d, tally):
        return best
    t = time_of(own, o, d, COARSE, tally)
    if not within(t, own, o, d, limit, tally):
        return best
    if best[1] >= 0:
        later = order(t, own, best[0], corners(triangles, best[1]), o, d, tally)
        if later > 0 or (later == 0 and best[1] < i):
            return best
    return t, i


@jit
def _grown(triangles: Floats, i: int, o: Vector, d: Vector, limit: float, grow: float, test: int) -> bool:
    """Whether triangle i, grown by `grow` bounds, lies on the ray within (0, limit] grown alike."""
    t, bound, margin = measure(corners(triangles, i), o, d, test)
    if not margin >= -grow:
        return False
    if bound < np.inf:
        return -grow * bound < t <= limit + grow * bound
    if grow <= 0.0:
        return False
    # A plane that float32 cannot tell from parallel has no useful t; the triangle's own box stands in for it.
    lower = (_least(triangles, i, 0), _least(triangles, i, 1), _least(triangles, i, 2))
    upper = (_most(triangles, i, 0), _most(triangles, i, 1), _most(triangles, i, 2))
    return _entry(lower, upper, o, d, limit, _GROWN_PAD) < np.inf


@inline
def _least(triangles: Floats, i: int, axis: int) -> float:
    return np.float64(min(triangles[i, 0, axis], triangles[i, 1, axis], triangles[i, 2, axis]))


@inline
def _most(triangles: Floats, i: int, axis: int) -> float:
    return np.float64(max(triangles[i, 0, axis], triangles[i, 1, axis], triangles[i, 2, axis]))


@jit
def _entry(lower: Vector, upper: Vector, o: Vector, d: Vector, limit: float, pad: float) -> float:
    """Where the ray enters a box, never too late; inf when it misses it or enters beyond `limit`."""
    near, far = 0.0, np.inf
    for k in range(3):
        below, above = lower[k] - o[k], upper[k] - o[k]
        if pad > 0.0:
            wider = pad * max(abs(below), abs(above))
            below, above = below - wider, above + wider
        if d[k] == 0.0:
            if below > 0.0 or above < 0.0:
                return np.inf
            continue
        first, last = below / d[k], above / d[k]
        if first > last:
            first, last = last, first
        near, far = max(near, first - _SLACK * abs(first)), min(far, last + _SLACK * abs(last))
    return near if near <= min(far, limit) else np.inf


@inline
def _node_entry(lower: Floats, upper: Floats, i: int, o: Vector, d: Vector, limit: float, pad: float) -> float:
    low = (np.float64(lower[i, 0]), np.float64(lower[i, 1]), np.float64(lower[i, 2]))
    high = (np.float64(upper[i, 0]), np.float64(upper[i, 1]), np.float64(upper[i, 2]))
    return _entry(low, high, o, d, limit, pad)
