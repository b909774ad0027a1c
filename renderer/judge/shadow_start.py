"""How well shadow rays leave their surfaces: each beside the exact ray from the exact hit point to the light.

The exact hit point is where, in real numbers, the primary ray as cast meets the plane of the triangle that was hit. A
light behind that plane is hidden by the triangle. The exact ray begins 2^-40 of the hit's magnitudes above the plane,
on the eye's side, which stands for the point itself: float32 resolves 2^-24 of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.judge import referee
from renderer.judge.court import Court
from renderer.judge.referee.walk import Doubles
from renderer.records import Flags, Floats, Records
from scenes.scene import Point

ABOVE = 2.0**-40
"""How far above its plane an exact ray starts, relative to what its hit point is computed from."""

_AROUND = ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))


@dataclass(frozen=True)
class Starts:
    """How many shadow rays went wrong where they start.

    `self_hit` report the triangle that they start on, though the exact ray is free; `blocked` something else, though it
    is free. `leak` miss what hides the light from the exact point; `start_edge` do so where float32 may: it need not be
    met from there, or from within the bound of the hit's t around there, or the ray as cast meets it within the bound.
    """

    self_hit: int
    blocked: int
    leak: int
    start_edge: int


def judge_starts(court: Court, records: Records, lights: Sequence[Point]) -> Starts:
    """Judge the shadow rays of `records`, whose hits name triangles, towards `lights`."""
    exact = _exact(court, records, np.array(lights, np.float32).reshape(-1, 3))
    hidden = exact.behind | referee.any_between(court.triangles, exact.origin, exact.way, court.bvh)
    known = np.isfinite(exact.origin).all(axis=1)
    dark = np.flatnonzero(known & records.occluded & ~hidden)
    free = np.flatnonzero(known & hidden & ~records.occluded)
    own, leak = _meets_own(court, records, dark), _must_meet(court, exact, free)
    leak &= ~court.occluded(records.shadow[free], 1.0)
    return Starts(int(own.sum()), int((~own).sum()), int(leak.sum()), int((~leak).sum()))


@dataclass(frozen=True, eq=False)
class _Exact:
    """The exact rays of s shadow rays: where they start and the way to the light, (s, 3).

    `around` (2, s, 3) are two directions in the plane, as long as the float32 bound of the hit's t; `behind` (s,) says
    whether the light is behind the plane.
    """

    origin: Doubles
    way: Doubles
    around: Doubles
    behind: Flags


def _exact(court: Court, records: Records, lights: Floats) -> _Exact:
    rays = records.primary[records.shadow_pixel]
    own = records.hits.primitive[records.shadow_pixel]
    eye, direction = rays.origin.astype(np.float64), rays.direction.astype(np.float64)
    way = referee.plane_t(court.triangles, rays, own)[:, None] * direction
    a, b, c = np.moveaxis(court.triangles[own].astype(np.float64), 1, 0)
    normal = _unit(np.cross(_unit(b - a), _unit(c - a)))
    normal *= np.where((normal * direction).sum(axis=1) > 0.0, -1.0, 1.0)[:, None]
    size = np.abs(eye).max(axis=1) + np.abs(way).max(axis=1)
    origin = eye + way + ABOVE * size[:, None] * normal
    light = lights[records.shadow_light].astype(np.float64)
    along = _unit(b - a) * referee.t_bound(court.triangles, rays, own, court.intersector)[:, None]
    around = np.stack([along, np.cross(normal, along)])
    return _Exact(origin, light - origin, around, (normal * (light - a)).sum(axis=1) < 0.0)


def _unit(vectors: Doubles) -> Doubles:
    unit: Doubles = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


def _must_meet(court: Court, exact: _Exact, index: npt.NDArray[np.intp]) -> Flags:
    """Whether float32, which knows a hit point to within a bound, must find what hides the light from it."""
    origin, way, around = exact.origin[index], exact.way[index], exact.around[:, index]
    sure = np.ones(len(index), np.bool_)
    for x, y in _AROUND:
        moved = x * around[0] + y * around[1]
        sure &= referee.any_between(court.triangles, origin + moved, way - moved, court.bvh, -1.0, court.intersector)
    return sure


def _meets_own(court: Court, records: Records, index: npt.NDArray[np.intp]) -> Flags:
    """Whether the triangle that each shadow ray starts on is what it reported, as far as can be told.

    It is if the ray as cast meets it first, or meets nothing exactly and it within the float32 bound.
    """
    rays, own = records.shadow[index], records.hits.primitive[records.shadow_pixel[index]]
    found = referee.closest(court.triangles, rays, court.bvh).primitive
    t = referee.plane_t(court.triangles, rays, own)
    room = referee.t_bound(court.triangles, rays, own, court.intersector)
    margin = referee.edge_margin(court.triangles, rays, own, court.intersector)
    near = (t > -room) & (t <= rays.reach + room) & (margin >= -1.0)
    meets: Flags = (found == own) | ((found < 0) & near)
    return meets
