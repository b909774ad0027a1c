"""Rays and triangles on which signs are hard to tell, each family by name, and what is right, in rationals."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from renderer.records import Floats, Rays

Doubles = npt.NDArray[np.float64]
Case = tuple[Floats, Rays]
Random = np.random.Generator

FARTHEST = np.float32(np.inf)
EMBREE_CENTRE = np.array([148376, 1234, -223423], np.float64)
"""Where Embree's own watertight test puts its sphere (tutorials/verify/verify.cpp)."""


def brute(triangles: Floats, rays: Rays) -> list[tuple[Fraction | None, int]]:
    """The smallest t in (0, reach], then the smallest primitive, of each ray; None and -1 for a miss."""
    found = []
    for r in range(len(rays)):
        hits = []
        for i, triangle in enumerate(triangles):
            t = crossing(triangle, rays.origin[r], rays.direction[r])
            if t is not None and t > 0 and (np.isinf(rays.reach[r]) or t <= rational(rays.reach[r])):
                hits.append((t, i))
        best = min(hits, default=(None, -1))
        found.append((best[0], best[1]))
    return found


def crossing(triangle: Floats, o: Floats, d: Floats) -> Fraction | None:
    """t, of either sign, where the ray's line crosses the closed triangle, by Cramer's rule; None where it misses."""
    v = [[rational(x) for x in corner] for corner in triangle]
    ray, start = [rational(x) for x in d], [rational(x) for x in o]
    e1, e2, s = ([p - q for p, q in zip(x, y, strict=True)] for x, y in ((v[1], v[0]), (v[2], v[0]), (start, v[0])))
    det = triple(e1, ray, e2)
    if det == 0:
        return None
    u, w, t = triple(s, ray, e2) / det, triple(ray, s, e1) / det, triple(e2, s, e1) / det
    return t if u >= 0 and w >= 0 and u + w <= 1 else None


def rational(x: np.float32) -> Fraction:
    """A float32 as the rational that it is."""
    return Fraction(float(x))


def triple(a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> Fraction:
    """a . (b x c)."""
    cross = (b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0])
    return a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]


def cast(origin: npt.ArrayLike, direction: npt.ArrayLike, reach: npt.ArrayLike = FARTHEST) -> Rays:
    """Rays of whatever broadcasts to (n, 3) and (n,)."""
    o, d = np.broadcast_arrays(np.array(origin, np.float32, ndmin=2), np.array(direction, np.float32, ndmin=2))
    return Rays(o.copy(), d.copy(), np.broadcast_to(np.array(reach, np.float32), len(o)).copy())


def sheet(rng: Random, cells: int = 3) -> Doubles:
    """A rough sheet around the origin, 2 cells^2 triangles that share edges and vertices, (m, 3, 3)."""
    at = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(at, at)
    points = np.stack([x, y, rng.normal(size=x.shape) * 0.3], axis=-1).astype(np.float32).astype(np.float64)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((a, b, c), (a, c, d))])


def aimed(rng: Random, triangles: Doubles, scale: float, offset: npt.ArrayLike, weights: Doubles) -> Case:
    """A placed mesh, and one ray a row of `weights` (n, 3) from somewhere above to that point of a random triangle."""
    placed = (triangles * scale + np.asarray(offset)).astype(np.float32)
    n = len(weights)
    corners = placed[rng.integers(0, len(placed), n)].astype(np.float64)
    target = np.einsum("nj,njk->nk", weights, corners)
    start = (rng.normal(size=(n, 3)) + np.array([0.0, 0.0, 4.0])) * scale + np.asarray(offset)
    origin = start.astype(np.float32)
    return placed, cast(origin, target - origin)


def along_edges(rng: Random, n: int) -> Doubles:
    """Barycentric weights of points on edges."""
    part = rng.random((n, 1))
    return rng.permuted(np.concatenate([part, 1 - part, np.zeros((n, 1))], axis=1), axis=1)


def at_vertices(rng: Random, n: int) -> Doubles:
    """Barycentric weights of vertices."""
    return np.eye(3)[rng.integers(0, 3, n)]


def placed(weights: Callable[[Random, int], Doubles], scale: float, offset: npt.ArrayLike) -> Callable[[Random], Case]:
    """A sheet somewhere, and 40 rays at its edges or vertices."""
    return lambda rng: aimed(rng, sheet(rng), scale, offset, weights(rng, 40))


def slivers(rng: Random) -> Case:
    """Triangles as thin as float32 allows, fanned around one long edge each."""
    base = rng.normal(size=(20, 1, 3)).astype(np.float32)
    along = rng.normal(size=(20, 1, 3)).astype(np.float32)
    corners = base + along * rng.random((20, 3, 1)).astype(np.float32)
    thin = np.nextafter(corners, rng.choice([-9, 9], (20, 3, 3)).astype(np.float32))
    return aimed(rng, thin.astype(np.float64), 1.0, (0, 0, 0), along_edges(rng, 40))


def specks(rng: Random) -> Case:
    """Triangles around the origin of 2^-60 of their distance, and rays whose lines pass exactly through the origin."""
    whole = rng.integers(-2, 3, (24, 3, 3)).astype(np.float64)
    ways = rng.normal(size=(40, 3)).astype(np.float32)
    return (whole * 2.0**-60).astype(np.float32), cast(-ways, ways * np.float32(0.25))


def beside_specks(rng: Random) -> Case:
    """The same, where the lines pass within 2^-60 of the origin too."""
    triangles, asked = specks(rng)
    beside = (rng.integers(-2, 3, (40, 3)) * 2.0**-60).astype(np.float32)
    asked.origin[:, :2] = 0
    asked.direction[:, :2] = 0
    asked.origin[:, :2] += beside[:, :2]
    return triangles, asked


def whole_numbers(rng: Random, scale: float = 1.0) -> Case:
    """Triangles and rays on small whole numbers: edges, vertices, planes and equal t are met all the time."""
    triangles = rng.integers(-2, 3, (24, 3, 3)) * scale
    origin, direction = rng.integers(-3, 4, (60, 3)) * scale, rng.integers(-2, 3, (60, 3))
    return triangles.astype(np.float32), cast(origin, direction)


def duplicates(rng: Random) -> Case:
    """Each triangle four times, its corners in another order: ties, in every tree's order."""
    triangles, asked = aimed(rng, sheet(rng, 2), 1.0, (0.1, 0.2, 0.3), along_edges(rng, 40))
    copies = np.concatenate([triangles[:, turn] for turn in ([0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1])])
    return rng.permutation(copies), asked


def in_planes(rng: Random) -> Case:
    """Rays from corner to corner, in the planes of triangles and along their edges."""
    triangles = (rng.integers(-8, 9, (16, 3, 3)) * 0.25).astype(np.float32)
    pairs = rng.integers(0, 16, (40, 2))
    a, b = triangles[pairs[:, 0], 0], triangles[pairs[:, rng.integers(0, 2)], 1]
    return triangles, cast(a - 2 * (b - a), b - a)


def fans(rng: Random) -> Case:
    """Triangles around one point that is hit: values of t that are equal, or that differ beyond float64."""
    point = rng.normal(size=3).astype(np.float32)
    triangles = np.stack([np.stack([point + rng.normal(size=3), point, point - rng.normal(size=3)]) for _ in range(20)])
    triangles[::3, 1] += rng.normal(size=(7, 3)) * 1e-7
    origin = (point + rng.normal(size=(40, 3))).astype(np.float32)
    return triangles.astype(np.float32), cast(origin, point - origin)


def coplanar(rng: Random) -> Case:
    """Triangles of one slanted plane that overlap: exact planes meet at equal t, rounded ones at all but equal t."""
    across = np.array([[1, 0, 0.25], [0, 1, -0.5]]) if rng.random() < 0.5 else rng.normal(size=(2, 3))
    corners = (rng.integers(-8, 9, (20, 3, 2)) / 4) @ across
    return aimed(rng, corners, 1.0, (0, 0, 0), rng.dirichlet((1, 1, 1), 40))


def reaches(rng: Random) -> Case:
    """Rays that end where t is, or one float32 before or behind it."""
    triangles, asked = aimed(rng, sheet(rng), 1.0, (0, 0, 0), rng.dirichlet((1, 1, 1), 40))
    exact = [t for t, _ in brute(triangles, asked)]
    ends = np.array([1.0 if t is None else float(t) for t in exact], np.float32)
    ends[::2] = np.nextafter(ends[::2], np.float32(0))
    asked.reach[:] = ends
    return triangles, asked


def reaches_exactly(rng: Random) -> Case:
    """Rays on whole numbers whose reach is a whole number, or just less."""
    triangles, asked = whole_numbers(rng)
    asked.reach[:] = rng.integers(1, 4, 60)
    asked.reach[::3] = np.nextafter(asked.reach[::3], np.float32(0))
    return triangles, asked


def of_all_sizes(rng: Random) -> Case:
    """Coordinates and directions over the whole range of float32, subnormal numbers among them."""
    exponent = rng.integers(-149, 120, (30, 3, 3))
    triangles = np.ldexp(rng.choice([-1.0, 1.0], (30, 3, 3)) * rng.integers(1, 9, (30, 3, 3)), exponent)
    weights = rng.dirichlet((0.3, 0.3, 0.3), 60)
    target = np.einsum("nj,njk->nk", weights, triangles[rng.integers(0, 30, 60)])
    way = np.ldexp(rng.normal(size=(60, 3)), rng.integers(-60, 60, (60, 3)))
    return triangles.astype(np.float32), cast(target - way, way)


ORIGIN = (0.0, 0.0, 0.0)
FAMILIES: dict[str, Callable[[Random], Case]] = {
    "edges": placed(along_edges, 1.0, ORIGIN),
    "vertices": placed(at_vertices, 1.0, ORIGIN),
    "edges at 1e6": placed(along_edges, 1e6, ORIGIN),
    "vertices at 1e-6": placed(at_vertices, 1e-6, ORIGIN),
    "edges at Embree's offset": placed(along_edges, 1.0, EMBREE_CENTRE),
    "vertices at Embree's offset": placed(at_vertices, 1.0, EMBREE_CENTRE),
    "slivers": slivers,
    "specks": specks,
    "beside specks": beside_specks,
    "whole numbers": whole_numbers,
    "subnormal whole numbers": lambda rng: whole_numbers(rng, 2.0**-148),
    "vast whole numbers": lambda rng: whole_numbers(rng, 2.0**125),
    "duplicates": duplicates,
    "in planes": in_planes,
    "fans": fans,
    "coplanar": coplanar,
    "reaches": reaches,
    "reaches exactly": reaches_exactly,
    "of all sizes": of_all_sizes,
}
