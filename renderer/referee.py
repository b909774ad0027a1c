"""The second judge: float64 over the very float32 rays, asked only where the oracle and the hit records disagree.

Float32 inputs are exact in float64. A triangle's three edge functions are the volumes d . (a x b) over the corners a
and b of an edge relative to the origin (Pluecker coordinates); they change sign exactly with the edge's direction, so
two triangles that share an edge never both miss a ray between them. t comes from the triangle's plane.

The float32 bound. Float32 Moller-Trumbore (1997) rounds e1, e2 and s = o - v0 once and decides by the signs of
U = s . (d x e2), V = d . (s x e1) and det - U - V, det = e1 . (d x e2). Let eps = 2^-24 and
gamma(n) = n eps / (1 - n eps) (Pharr, Jakob, Humphreys, section 6.8). A triple product costs 1 + 1 for rounded
inputs, 2 for the cross product and 3 for the dot product: gamma(7) times at most sqrt(2) |a||b||c|, since a cross
product of absolute values is at most sqrt(2) |a||b|. Comparing u + v with 1 after the division adds
3 eps |d||e1||e2|. To first order in eps, k = 13 >= 7 sqrt(2) + 3 covers them all:

    edge v0 v1:  |error| <= k eps |d| |s| |e1|              edge v2 v0:  |error| <= k eps |d| |s| |e2|
    edge v1 v2:  |error| <= k eps |d| (|s| (|e1| + |e2|) + |e1||e2|)
    t:           |error| <= k eps (|s| + |t||d|) |e1||e2| / (|det| - k eps |d||e1||e2|)

A volume is |edge| |n . d| times the distance, in the triangle's plane, from the ray's plane point to the edge (n of
length 1). In that distance the first line reads k eps |s| |d| / |n . d|: it grows with the distance to the triangle and
with grazing, and not with the distance of both from the world's origin. `edge_margin` is distance / bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from renderer.build.tree import Bvh
from renderer.records import Flags, Floats, Ints, Rays

Doubles = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

BOUND = 13 * 2.0**-24
"""k eps of the float32 bound above."""

_SLACK = 1e-12
"""Relative widening of a slab's entry and exit; float64 rounding in a slab test is below 1e-15."""

_GROWN_PAD = 64 * 2.0**-24
"""How far boxes grow, relative to their distance, when triangles are grown by the bound."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The closest hit of n rays: `t` (n,) float64, inf for a miss; `primitive` (n,) int32, -1 for a miss."""

    t: Doubles
    primitive: Ints


def closest(triangles: Floats, rays: Rays, bvh: Bvh | None = None) -> Verdict:
    """The smallest t in (0, reach], then the smallest primitive, over `triangles` (m, 3, 3) float32.

    Two-sided; rays in a triangle's plane, degenerate triangles and non-finite rays miss. Without `bvh` every ray
    meets every triangle, which is about 20 ns each; the answer is the same.
    """
    return _cast(triangles, rays, bvh, 0.0, rays.reach.astype(np.float64), False)


def any_hit(
    triangles: Floats, rays: Rays, bvh: Bvh | None = None, grow: float = 0.0, limit: Doubles | None = None
) -> Flags:
    """Whether a triangle lies on each ray with t in (0, limit], (n,) bool; `limit` (n,) float64 is the reach if None.

    Every triangle, and the interval of t, is grown by `grow` float32 bounds: with 1 every hit that float32 could
    find counts, with -1 only those that it must find.
    """
    limit = rays.reach.astype(np.float64) if limit is None else limit
    return _cast(triangles, rays, bvh, grow, limit, True).primitive >= 0


def plane_t(triangles: Floats, rays: Rays, primitive: Ints) -> Doubles:
    """Where each ray meets the plane of its `primitive` (n,), (n,) float64; NaN without one or when parallel to it."""
    return _figures(triangles, rays, primitive)[0]


def t_bound(triangles: Floats, rays: Rays, primitive: Ints) -> Doubles:
    """The float32 bound on the error of t for each ray's `primitive` (n,), (n,) float64; inf where t means nothing."""
    return _figures(triangles, rays, primitive)[1]


def edge_margin(triangles: Floats, rays: Rays, primitive: Ints) -> Doubles:
    """Signed distance to the edges of each ray's `primitive` (n,) over its bound, (n,) float64, NaN without one.

    The smallest of the three edges, positive inside: float32 may decide either way within [-1, 1].
    """
    return _figures(triangles, rays, primitive)[2]


def _cast(triangles: Floats, rays: Rays, bvh: Bvh | None, grow: float, limit: Doubles, first: bool) -> Verdict:
    t, primitive = np.full(len(rays), np.inf), np.full(len(rays), -1, np.int32)
    if len(triangles):
        lower, upper, child, count, order, depth = _nodes(bvh, len(triangles))
        nodes = (lower, upper, child, count, order)
        origin, direction = rays.origin.astype(np.float64), rays.direction.astype(np.float64)
        _cast_all(triangles, nodes, depth + 2, origin, direction, limit, grow, first, t, primitive)
    return Verdict(t, primitive)


def _nodes(bvh: Bvh | None, m: int) -> tuple[Floats, Floats, Ints, Ints, Ints, int]:
    """The structure to walk: without one, a single unbounded leaf."""
    if bvh is not None:
        return bvh.lower, bvh.upper, bvh.child, bvh.count, bvh.order, bvh.depth
    everywhere = np.full((1, 3), np.inf, np.float32)
    leaf = (np.zeros(1, np.int32), np.full(1, m, np.int32), np.arange(m, dtype=np.int32))
    return -everywhere, everywhere, *leaf, 0


def _figures(triangles: Floats, rays: Rays, primitive: Ints) -> tuple[Doubles, Doubles, Doubles]:
    out = np.full((3, len(rays)), np.nan)
    out[1] = np.inf
    _figures_all(triangles, rays.origin.astype(np.float64), rays.direction.astype(np.float64), primitive, out)
    return out[0], out[1], out[2]


@njit(cache=True, inline="always")
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, inline="always")
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, inline="always")
def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, inline="always")
def _length(a: Vector) -> float:
    return math.sqrt(_dot(a, a))


@njit(cache=True, inline="always")
def _corner(triangles: Floats, i: int, j: int, o: Vector) -> Vector:
    """Corner j of triangle i relative to the ray's origin."""
    return (
        np.float64(triangles[i, j, 0]) - o[0],
        np.float64(triangles[i, j, 1]) - o[1],
        np.float64(triangles[i, j, 2]) - o[2],
    )


@njit(cache=True, error_model="numpy", nogil=True)
def _exact(triangles: Floats, i: int, o: Vector, d: Vector) -> float:
    """The t at which the ray's line meets triangle i, inf when it does not."""
    a, b = _corner(triangles, i, 0, o), _corner(triangles, i, 1, o)
    w01 = _dot(d, _cross(a, b))
    c = _corner(triangles, i, 2, o)
    w12 = _dot(d, _cross(b, c))
    if (w01 < 0 < w12) or (w12 < 0 < w01):
        return np.inf
    w20 = _dot(d, _cross(c, a))
    if min(w01, w12, w20) < 0 < max(w01, w12, w20):
        return np.inf
    normal = _cross(_minus(b, a), _minus(c, a))
    det = _dot(normal, d)
    return _dot(normal, a) / det if det != 0.0 else np.inf


@njit(cache=True, error_model="numpy", nogil=True)
def _measure(triangles: Floats, i: int, o: Vector, d: Vector) -> Vector:
    """Plane t (NaN when parallel), its float32 bound, and the edge margin of triangle i."""
    a, b, c = _corner(triangles, i, 0, o), _corner(triangles, i, 1, o), _corner(triangles, i, 2, o)
    e1, e2 = _minus(b, a), _minus(c, a)
    s, l1, l2 = _length(a), _length(e1), _length(e2)
    normal = _cross(e1, e2)
    det = _dot(normal, d)
    unit = BOUND * _length(d)
    t = _dot(normal, a) / det if det != 0.0 else np.nan
    rest = abs(det) - unit * l1 * l2
    bound = BOUND * (s + abs(t) * _length(d)) * l1 * l2 / rest if rest > 0.0 else np.inf
    sign = -1.0 if det < 0.0 else 1.0
    m01 = _ratio(sign * _dot(d, _cross(a, b)), unit * s * l1)
    m20 = _ratio(sign * _dot(d, _cross(c, a)), unit * s * l2)
    m12 = _ratio(sign * _dot(d, _cross(b, c)), unit * (s * (l1 + l2) + l1 * l2))
    return t, bound, min(m01, m20, m12)


@njit(cache=True, inline="always")
def _ratio(distance: float, bound: float) -> float:
    return distance / bound if bound > 0.0 else 0.0


@njit(cache=True, error_model="numpy", nogil=True)
def _grown(triangles: Floats, i: int, o: Vector, d: Vector, limit: float, grow: float) -> bool:
    """Whether triangle i, grown by `grow` bounds, lies on the ray within (0, limit] grown alike."""
    t, bound, margin = _measure(triangles, i, o, d)
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


@njit(cache=True, inline="always")
def _least(triangles: Floats, i: int, axis: int) -> float:
    return np.float64(min(triangles[i, 0, axis], triangles[i, 1, axis], triangles[i, 2, axis]))


@njit(cache=True, inline="always")
def _most(triangles: Floats, i: int, axis: int) -> float:
    return np.float64(max(triangles[i, 0, axis], triangles[i, 1, axis], triangles[i, 2, axis]))


@njit(cache=True, error_model="numpy", nogil=True)
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


@njit(cache=True, inline="always")
def _node_entry(lower: Floats, upper: Floats, i: int, o: Vector, d: Vector, limit: float, pad: float) -> float:
    low = (np.float64(lower[i, 0]), np.float64(lower[i, 1]), np.float64(lower[i, 2]))
    high = (np.float64(upper[i, 0]), np.float64(upper[i, 1]), np.float64(upper[i, 2]))
    return _entry(low, high, o, d, limit, pad)


@njit(cache=True, error_model="numpy", nogil=True)
def _leaf(
    triangles: Floats, slots: Ints, o: Vector, d: Vector, limit: float, grow: float, best: tuple[float, int]
) -> tuple[float, int]:
    """The better of `best` (t, primitive) and the triangles that a leaf holds."""
    t, primitive = best
    for slot in range(len(slots)):
        i = slots[slot]
        if grow != 0.0:
            if _grown(triangles, i, o, d, limit, grow):
                return 0.0, i
            continue
        found = _exact(triangles, i, o, d)
        if 0.0 < found <= limit and (found < t or (found == t and i < primitive)):
            t, primitive = found, i
    return t, primitive


@njit(cache=True, error_model="numpy", nogil=True)
def _walk(
    triangles: Floats,
    nodes: tuple[Floats, Floats, Ints, Ints, Ints],
    stack: Ints,
    entries: Doubles,
    o: Vector,
    d: Vector,
    limit: float,
    grow: float,
    first: bool,
) -> tuple[float, int]:
    """The closest hit of one ray, or any hit when `first` is set."""
    lower, upper, child, count, order = nodes
    pad = _GROWN_PAD if grow > 0.0 else 0.0
    reach = np.inf if grow > 0.0 else limit  # a grown triangle may count from beyond the limit
    best = (np.inf, -1)
    stack[0], entries[0], top = 0, _node_entry(lower, upper, 0, o, d, reach, pad), 1
    while top > 0:
        top -= 1
        node = stack[top]
        if entries[top] == np.inf or entries[top] > best[0]:
            continue
        if count[node] > 0:
            best = _leaf(triangles, order[child[node] : child[node] + count[node]], o, d, limit, grow, best)
            if first and best[1] >= 0:
                return best
            continue
        left = child[node]
        end = min(reach, best[0])
        near, far = (
            _node_entry(lower, upper, left, o, d, end, pad),
            _node_entry(lower, upper, left + 1, o, d, end, pad),
        )
        swap = near > far
        stack[top], entries[top] = (left, near) if swap else (left + 1, far)
        stack[top + 1], entries[top + 1] = (left + 1, far) if swap else (left, near)
        top += 2
    return best


@njit(cache=True, error_model="numpy", nogil=True)
def _cast_all(
    triangles: Floats,
    nodes: tuple[Floats, Floats, Ints, Ints, Ints],
    room: int,
    origin: Doubles,
    direction: Doubles,
    limit: Doubles,
    grow: float,
    first: bool,
    t: Doubles,
    primitive: Ints,
) -> None:
    stack, entries = np.empty(room, np.int32), np.empty(room)
    for r in range(len(origin)):
        o = (origin[r, 0], origin[r, 1], origin[r, 2])
        d = (direction[r, 0], direction[r, 1], direction[r, 2])
        if math.isfinite(o[0] + o[1] + o[2] + d[0] + d[1] + d[2]):
            t[r], primitive[r] = _walk(triangles, nodes, stack, entries, o, d, limit[r], grow, first)


@njit(cache=True, error_model="numpy", nogil=True)
def _figures_all(triangles: Floats, origin: Doubles, direction: Doubles, primitive: Ints, out: Doubles) -> None:
    for r in range(len(origin)):
        if primitive[r] >= 0:
            o = (origin[r, 0], origin[r, 1], origin[r, 2])
            d = (direction[r, 0], direction[r, 1], direction[r, 2])
            out[0, r], out[1, r], out[2, r] = _measure(triangles, primitive[r], o, d)
