"""The court: what an answer to a ray is called, given the referee's.

Two hits are the same when they name the same primitive, or when the ray meets both primitives (within the float32
bound of their edges) at values of t that float32 cannot tell apart: shared edges and coincident surfaces are ties.
What is left is an edge case when float32 could have decided either way, that is when the primitive that we report is
hit within the bound (see `renderer.judge.referee`; the ends of the ray's interval count as edges too) and nothing that
float32 must find lies in front of it. Otherwise it is a false hit, a false miss or a wrong primitive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh
from renderer.judge import referee
from renderer.judge.oracle import Oracle
from renderer.judge.referee import Verdict
from renderer.records import Flags, Floats, Hits, Ints, Rays

Kinds = npt.NDArray[np.int8]

TIE = 2.0**-10
"""The largest relative distance in t of a tie, however grazing the triangles are."""

EMBREE = "embree"
"""Whose float32 bound is the widest: which test Embree runs depends on its build."""

AGREE, FALSE_HIT, FALSE_MISS, WRONG_PRIMITIVE, EDGE = range(5)


@dataclass(frozen=True, eq=False)
class Court:
    """Who judges the answers of which intersector, and over which triangles."""

    triangles: Floats
    oracle: Oracle | None
    bvh: Bvh | None
    referee: bool
    intersector: str

    def truth(self, rays: Rays) -> Verdict:
        """The referee's closest hits."""
        return referee.closest(self.triangles, rays, self.bvh)

    def occluded(self, rays: Rays, grow: float = 0.0) -> Flags:
        """The referee's answer to shadow rays, the triangles grown by `grow` bounds."""
        return referee.any_hit(self.triangles, rays, self.bvh, grow, intersector=self.intersector)


def raw_kinds(mine: Ints, theirs: Ints) -> Kinds:
    """What a disagreement with `theirs` is called, by who hit something."""
    kinds = np.where(theirs < 0, FALSE_HIT, np.where(mine < 0, FALSE_MISS, WRONG_PRIMITIVE))
    return np.where(mine == theirs, AGREE, kinds).astype(np.int8)


def ties(court: Court, rays: Rays, mine: Ints, theirs: Verdict, intersector: str) -> Flags:
    """Whether each ray meets both primitives, at the same t as far as float32 can tell."""
    triangles = court.triangles
    t = referee.plane_t(triangles, rays, mine)
    room = referee.t_bound(triangles, rays, mine, intersector)
    room += referee.t_bound(triangles, rays, theirs.primitive, EMBREE)
    both = (mine >= 0) & (theirs.primitive >= 0)
    met = referee.edge_margin(triangles, rays, mine, intersector) >= -1.0
    near = np.zeros(len(rays), np.bool_)
    near[both] = np.abs(t[both] - theirs.t[both]) <= np.minimum(room[both], TIE * theirs.t[both])
    return both & met & near


def settle(court: Court, rays: Rays, hits: Hits, truth: Verdict, intersector: str) -> Kinds:
    """What the answers `hits` of an intersector are called where `truth` is the referee's, (n,)."""
    kinds = raw_kinds(hits.primitive, truth.primitive)
    kinds[ties(court, rays, hits.primitive, truth, intersector)] = AGREE
    rest = np.flatnonzero(kinds != AGREE)
    kinds[rest[_either_way(court, rays[rest], hits_of(hits, rest), intersector)]] = EDGE
    return kinds


def _either_way(court: Court, rays: Rays, hits: Hits, intersector: str) -> Flags:
    """Whether float32 could have found each of `hits`, and need not have found anything before it."""
    triangles, mine = court.triangles, hits.primitive
    t, room = referee.plane_t(triangles, rays, mine), referee.t_bound(triangles, rays, mine, intersector)
    reach = rays.reach.astype(np.float64)
    # A triangle without area has no t at all; float32 may take it for one that has, and the bound says near which line.
    inside = ((t > -room) & (t - room <= reach)) | np.isinf(room)
    plausible = (mine < 0) | ((referee.edge_margin(triangles, rays, mine, intersector) >= -1.0) & inside)
    # Where float32 cannot tell the plane from parallel, the t that it found is all there is to go by.
    ours = np.where(np.isfinite(room), t - room, hits.t)
    limit = np.where(mine < 0, reach, ours)
    missed = referee.any_hit(triangles, rays, court.bvh, grow=-1.0, limit=limit, intersector=intersector)
    return plausible & ~missed


def hits_of(hits: Hits, index: npt.NDArray[np.intp]) -> Hits:
    """The hits that `index` selects."""
    return Hits(hits.t[index], hits.primitive[index])
