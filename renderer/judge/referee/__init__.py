"""The second judge: exact over the very float32 rays, asked only where the oracle and the hit records disagree.

What is right is defined for real numbers, and every sign that decides it is found exactly (`decide`, `exact`). A ray is
the points o + t d with 0 < t <= reach, t in units of d, whose length is free; its numbers are float32 and taken as they
are, the smallest included.

1. Triangles are closed: a ray through an edge or a vertex hits every triangle that has it. Hence two triangles that
   share an edge never both miss a ray between them, and a closed surface has no holes.
2. The hit is the smallest t, compared as a rational number; of equal ones the smallest primitive id.
3. A ray in a triangle's plane misses it: line and plane do not meet in one point, so there is no t to report. A closed
   surface loses nothing by that: where such a ray enters the flat part of it that lies in the plane, it crosses an edge
   of a triangle that does not, and hits that one.
4. Degenerate triangles, which have no area, are never hit: every line is parallel to their normal's plane, 0 = 0.
5. A ray with a NaN or an infinity in origin or direction, or with a NaN as its reach, hits nothing, and so does one
   without direction. Triangles with such coordinates are never hit. A reach of infinity is no limit.

`bound` says how far float32 may be from that near edges.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from renderer.build.tree import Bvh
from renderer.judge.referee.bound import EITHER, MOLLER_TRUMBORE, WATERTIGHT
from renderer.judge.referee.decide import Tally
from renderer.judge.referee.walk import Doubles, Nodes, cast_all, figures_all
from renderer.records import Flags, Floats, Ints, Rays

PAPERS = "moller-trumbore"
_TESTS = {PAPERS: MOLLER_TRUMBORE, "watertight": WATERTIGHT}


@dataclass(frozen=True, eq=False)
class Verdict:
    """The closest hit of n rays: `t` (n,) float64, inf for a miss; `primitive` (n,) int32, -1 for a miss.

    `t` is within 2^-43 of the exact value, relatively. `exact` (3,) int64 counts the sides of
    edges, the values of t and the comparisons of t that float64 left open, so that expansions decided them.
    """

    t: Doubles
    primitive: Ints
    exact: Tally = field(default_factory=lambda: np.zeros(3, np.int64))


def closest(triangles: Floats, rays: Rays, bvh: Bvh | None = None) -> Verdict:
    """The smallest t in (0, reach], then the smallest primitive, over `triangles` (m, 3, 3) float32.

    Two-sided. Without `bvh` every ray meets every triangle, which is about 20 ns each; the answer is the same.
    """
    return _cast(triangles, rays, bvh, 0.0, rays.reach.astype(np.float64), False, PAPERS)


def any_hit(
    triangles: Floats,
    rays: Rays,
    bvh: Bvh | None = None,
    grow: float = 0.0,
    limit: Doubles | None = None,
    intersector: str = PAPERS,
) -> Flags:
    """Whether a triangle lies on each ray with t in (0, limit], (n,) bool; `limit` (n,) float64 is the reach if None.

    Every triangle, and the interval of t, is grown by `grow` float32 bounds: with 1 every hit that float32 could
    find counts, with -1 only those that it must find; both are then decided in plain float64. The bound is that of
    `intersector`, here and below; one that has none of its own gets the widest.
    """
    limit = rays.reach.astype(np.float64) if limit is None else limit
    return _cast(triangles, rays, bvh, grow, limit, True, intersector).primitive >= 0


def any_between(
    triangles: Floats,
    origin: Doubles,
    way: Doubles,
    bvh: Bvh | None = None,
    grow: float = 0.0,
    intersector: str = PAPERS,
) -> Flags:
    """Whether a triangle lies between each `origin` (n, 3) and `origin` + `way` (n, 3), the end included, (n,) bool.

    As `any_hit`, for rays that no device cast: their numbers need not be float32, and are taken as they are.
    """
    return _cast_doubles(triangles, origin, way, bvh, grow, np.ones(len(origin)), True, intersector).primitive >= 0


def plane_t(triangles: Floats, rays: Rays, primitive: Ints) -> Doubles:
    """Where each ray meets the plane of its `primitive` (n,), (n,) float64; NaN without one or when parallel to it."""
    return _figures(triangles, rays, primitive, PAPERS)[0]


def t_bound(triangles: Floats, rays: Rays, primitive: Ints, intersector: str = PAPERS) -> Doubles:
    """The float32 bound on the error of t for each ray's `primitive` (n,), (n,) float64; inf where t means nothing."""
    return _figures(triangles, rays, primitive, intersector)[1]


def edge_margin(triangles: Floats, rays: Rays, primitive: Ints, intersector: str = PAPERS) -> Doubles:
    """Signed distance to the edges of each ray's `primitive` (n,) over its bound, (n,) float64, NaN without one.

    The smallest of the three edges, positive inside: float32 may decide either way within [-1, 1].
    """
    return _figures(triangles, rays, primitive, intersector)[2]


def _cast(
    triangles: Floats, rays: Rays, bvh: Bvh | None, grow: float, limit: Doubles, first: bool, intersector: str
) -> Verdict:
    origin, direction = rays.origin.astype(np.float64), rays.direction.astype(np.float64)
    return _cast_doubles(triangles, origin, direction, bvh, grow, limit, first, intersector)


def _cast_doubles(
    triangles: Floats,
    origin: Doubles,
    direction: Doubles,
    bvh: Bvh | None,
    grow: float,
    limit: Doubles,
    first: bool,
    intersector: str,
) -> Verdict:
    t, primitive = np.full(len(origin), np.inf), np.full(len(origin), -1, np.int32)
    tally = np.zeros(3, np.int64)
    if len(triangles):
        nodes, depth = _nodes(bvh, len(triangles))
        test = _TESTS.get(intersector, EITHER)
        cast_all(triangles, nodes, depth + 2, origin, direction, limit, grow, test, first, t, primitive, tally)
    return Verdict(t, primitive, tally)


def _nodes(bvh: Bvh | None, m: int) -> tuple[Nodes, int]:
    """The structure to walk and its depth: without one, a single unbounded leaf."""
    if bvh is not None:
        return (bvh.lower, bvh.upper, bvh.child, bvh.count, bvh.order), bvh.depth
    everywhere = np.full((1, 3), np.inf, np.float32)
    leaf = (np.zeros(1, np.int32), np.full(1, m, np.int32), np.arange(m, dtype=np.int32))
    return (-everywhere, everywhere, *leaf), 0


def _figures(triangles: Floats, rays: Rays, primitive: Ints, intersector: str) -> tuple[Doubles, Doubles, Doubles]:
    out = np.full((3, len(rays)), np.nan)
    out[1] = np.inf
    origin, direction = rays.origin.astype(np.float64), rays.direction.astype(np.float64)
    figures_all(triangles, origin, direction, primitive, _TESTS.get(intersector, EITHER), out)
    return out[0], out[1], out[2]
