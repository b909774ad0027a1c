"""The error of a run: hit records against the oracle, and the referee's verdict wherever the two disagree.

Two hits are the same when they name the same primitive, or when the ray meets both primitives (within the float32
bound of their edges) at values of t that float32 cannot tell apart: shared edges and coincident surfaces are ties.
What is left is an edge case when float32 could have decided either way, that is when the primitive that we report is
hit within the bound (see `renderer.referee`; the ends of the ray's interval count as edges too) and nothing that
float32 must find lies in front of it. Otherwise it is a false hit, a false miss or a wrong primitive. Where the oracle
agrees with us the referee is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from renderer import referee
from renderer.build.tree import Bvh
from renderer.oracle import Oracle
from renderer.records import Flags, Floats, Hits, Ints, Rays, Records
from renderer.referee import Verdict
from renderer.request import Check

Kinds = npt.NDArray[np.int8]

TIE = 2.0**-10
"""The largest relative distance in t of a tie, however grazing the triangles are."""

AGREE, FALSE_HIT, FALSE_MISS, WRONG_PRIMITIVE, EDGE = range(5)


@dataclass(frozen=True)
class Errors:
    """The error of a run; None is what was not measured, for instance everything with check "none".

    `false_hit`, `false_miss`, `edge`, `wrong_primitive`, and for a hybrid plan `raster_mismatch` (hit or miss against
    the rays), are fractions of the primary rays; `shadow_mismatch` and `shadow_edge` of the shadow rays. `t_rel_p99`,
    `t_rel_max` and `t_ulp_max` (float32 ulps) compare t with the float64 t of the same primitive's plane along the
    same ray. `flip` is an image's figure and not filled in here. `counts` are the numbers of rays behind the
    fractions, with `embree_wrong` and `shadow_embree_wrong`: disagreements in which the referee sided with us.
    """

    false_hit: float | None = None
    false_miss: float | None = None
    edge: float | None = None
    wrong_primitive: float | None = None
    t_rel_p99: float | None = None
    t_rel_max: float | None = None
    t_ulp_max: float | None = None
    shadow_mismatch: float | None = None
    shadow_edge: float | None = None
    raster_mismatch: float | None = None
    flip: float | None = None
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Difference:
    """How two runs of one image differ, bit for bit: numbers of rays, and the first pixels of each kind.

    `rays` counts primary rays, `shadow_rays` shadow rays (by pixel and light), whose bits differ or that only one run
    cast; `hit`, `primitive`, `t` differing primary results; `shadow` differing answers of shadow rays cast by both.
    """

    rays: int
    hit: int
    primitive: int
    t: int
    shadow_rays: int
    shadow: int
    first: dict[str, tuple[int, ...]]

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        return not self.first


def judge(triangles: Floats, records: Records, oracle: Oracle | None, bvh: Bvh | None, check: Check) -> Errors:
    """Judge `records` of a scene with `triangles` (m, 3, 3) float32.

    "oracle" counts raw disagreements and leaves `edge` None; "referee" settles them in float64, along `bvh` or, without
    one, against every triangle. With "referee" the oracle may be None: then the referee is asked for every ray.
    """
    if check == "none":
        return Errors()
    if check not in ("oracle", "referee"):
        raise ValueError(f'Check "{check}" is unknown; choose none, oracle or referee.')
    if oracle is None and check == "oracle":
        raise ValueError('Check "oracle" needs an oracle; give one, or choose referee.')
    if len(triangles) <= int(records.hits.primitive.max(initial=-1)):
        raise ValueError("A hit names a triangle that the scene has not; judge records with their own scene.")
    court = _Court(triangles, oracle, bvh, check == "referee")
    figures, counts = _raster(court, records) if records.rasterised else _primary(court, records)
    shadow_figures, shadow_counts = _shadow(court, records)
    return Errors(**figures, **shadow_figures, counts=counts | shadow_counts)


def identical(a: Records, b: Records) -> Difference:
    """Compare two runs of the same image bit for bit; a size that differs is a ValueError."""
    if a.size != b.size:
        raise ValueError("Two runs can only be compared at the same size; measure both at one size.")
    differs = {
        "rays": _ray_bits(a.primary, b.primary),
        "hit": (a.hits.primitive == -1) != (b.hits.primitive == -1),
        "primitive": a.hits.primitive != b.hits.primitive,
        "t": _bits(a.hits.t) != _bits(b.hits.t),
    }
    primary = {name: np.flatnonzero(flags) for name, flags in differs.items()}
    pixels = primary | _shadow_pixels(a, b)
    first = {name: tuple(int(p) for p in where[:8]) for name, where in pixels.items() if len(where)}
    return Difference(**{name: len(where) for name, where in pixels.items()}, first=first)


@dataclass(frozen=True, eq=False)
class _Court:
    """Who judges, and over which triangles."""

    triangles: Floats
    oracle: Oracle | None
    bvh: Bvh | None
    referee: bool


_Figures = tuple[dict[str, float | None], dict[str, int]]


def _primary(court: _Court, records: Records) -> _Figures:
    rays, hits = records.primary, records.hits
    kinds, embree_wrong = _kinds(court, rays, hits)
    counts = {
        "primary": len(rays),
        "hits": int((hits.primitive >= 0).sum()),
        "false_hit": int((kinds == FALSE_HIT).sum()),
        "false_miss": int((kinds == FALSE_MISS).sum()),
        "wrong_primitive": int((kinds == WRONG_PRIMITIVE).sum()),
    }
    if court.referee:
        counts["edge"] = int((kinds == EDGE).sum())
        if court.oracle is not None:
            counts["embree_wrong"] = embree_wrong
    names = ("false_hit", "false_miss", "wrong_primitive", "edge")
    figures = {name: _fraction(counts.get(name), len(rays)) for name in names}
    return figures | _t_errors(court.triangles, rays, hits), counts


def _kinds(court: _Court, rays: Rays, hits: Hits) -> tuple[Kinds, int]:
    """The kind of each ray's answer, (n,), and how often the referee sided with us against the oracle."""
    mine = hits.primitive
    kinds = np.full(len(rays), AGREE, np.int8)
    suspects = np.arange(len(rays))
    if court.oracle is not None:
        found = court.oracle.closest(rays)
        suspects = np.flatnonzero(found.primitive != mine)
        theirs = Verdict(found.t[suspects].astype(np.float64), found.primitive[suspects])
        suspects = suspects[~_ties(court.triangles, rays[suspects], mine[suspects], theirs)]
        kinds[suspects] = _raw_kinds(mine[suspects], found.primitive[suspects])
    if court.referee:
        kinds[suspects] = _settle(court, rays[suspects], Hits(hits.t[suspects], mine[suspects]))
    return kinds, int((kinds[suspects] == AGREE).sum())


def _raw_kinds(mine: Ints, theirs: Ints) -> Kinds:
    """What a disagreement with `theirs` is called, by who hit something."""
    kinds = np.where(theirs < 0, FALSE_HIT, np.where(mine < 0, FALSE_MISS, WRONG_PRIMITIVE))
    return np.where(mine == theirs, AGREE, kinds).astype(np.int8)


def _ties(triangles: Floats, rays: Rays, mine: Ints, theirs: Verdict) -> Flags:
    """Whether each ray meets both primitives, at the same t as far as float32 can tell."""
    t = referee.plane_t(triangles, rays, mine)
    room = referee.t_bound(triangles, rays, mine) + referee.t_bound(triangles, rays, theirs.primitive)
    both = (mine >= 0) & (theirs.primitive >= 0)
    met = referee.edge_margin(triangles, rays, mine) >= -1.0
    near = np.zeros(len(rays), np.bool_)
    near[both] = np.abs(t[both] - theirs.t[both]) <= np.minimum(room[both], TIE * theirs.t[both])
    return both & met & near


def _settle(court: _Court, rays: Rays, hits: Hits) -> Kinds:
    """The referee's kinds for rays in dispute."""
    triangles, mine = court.triangles, hits.primitive
    truth = referee.closest(triangles, rays, court.bvh)
    t, room = referee.plane_t(triangles, rays, mine), referee.t_bound(triangles, rays, mine)
    reach = rays.reach.astype(np.float64)
    inside = (t > -room) & (t - room <= reach)
    plausible = (mine < 0) | ((referee.edge_margin(triangles, rays, mine) >= -1.0) & inside)
    # Where float32 cannot tell the plane from parallel, the t that it found is all there is to go by.
    ours = np.where(np.isfinite(room), t - room, hits.t)
    limit = np.where(mine < 0, reach, ours)
    missed = referee.any_hit(triangles, rays, court.bvh, grow=-1.0, limit=limit)
    kinds = np.where(plausible & ~missed, EDGE, _raw_kinds(mine, truth.primitive))
    agree = (mine == truth.primitive) | _ties(triangles, rays, mine, truth)
    return np.where(agree, AGREE, kinds).astype(np.int8)


def _t_errors(triangles: Floats, rays: Rays, hits: Hits) -> dict[str, float | None]:
    """Percentile and maxima of the error of t over the hits whose plane the ray crosses."""
    hit = hits.primitive >= 0
    exact = referee.plane_t(triangles, rays[hit], hits.primitive[hit])
    usable = np.isfinite(hits.t[hit]) & (np.abs(exact) < np.finfo(np.float32).max) & (exact != 0.0)
    exact, t = exact[usable], hits.t[hit][usable].astype(np.float64)
    if not len(exact):
        return {"t_rel_p99": None, "t_rel_max": None, "t_ulp_max": None}
    error = np.abs(t - exact)
    relative = error / np.abs(exact)
    ulps = error / np.spacing(np.abs(exact).astype(np.float32)).astype(np.float64)
    return {
        "t_rel_p99": float(np.percentile(relative, 99)),
        "t_rel_max": float(relative.max()),
        "t_ulp_max": float(ulps.max()),
    }


def _raster(court: _Court, records: Records) -> _Figures:
    """A rasteriser's visibility against the rays': only hit or miss can be compared."""
    rays, hit = records.primary, records.hits.primitive != -1
    truth = _visible(court, rays, hit)
    mismatches = int((truth != hit).sum())
    counts = {"primary": len(rays), "hits": int(hit.sum()), "raster_mismatch": mismatches}
    return {"raster_mismatch": _fraction(mismatches, len(rays))}, counts


def _visible(court: _Court, rays: Rays, hit: Flags) -> Flags:
    """Whether each ray hits anything, by the oracle and, where it contradicts `hit`, the referee."""
    answer = court.oracle.closest(rays).primitive >= 0 if court.oracle is not None else ~hit
    suspects = np.flatnonzero(answer != hit)
    if court.referee:
        answer[suspects] = referee.any_hit(court.triangles, rays[suspects], court.bvh)
    return answer


def _shadow(court: _Court, records: Records) -> _Figures:
    rays, mine = records.shadow, records.occluded
    answer = court.oracle.occluded(rays) if court.oracle is not None else ~mine
    suspects = np.flatnonzero(answer != mine)
    counts = {"shadow": len(rays), "shadow_mismatch": len(suspects)}
    if court.referee:
        disputed, ours = rays[suspects], mine[suspects]
        wrong = referee.any_hit(court.triangles, disputed, court.bvh) != ours
        # Occluded is within the bound if a grown triangle occludes; free, if no shrunk one does.
        grow, shrink = (referee.any_hit(court.triangles, disputed, court.bvh, grow=g) for g in (1.0, -1.0))
        edge = wrong & np.where(ours, grow, ~shrink)
        counts["shadow_mismatch"], counts["shadow_edge"] = int((wrong & ~edge).sum()), int(edge.sum())
        if court.oracle is not None:
            counts["shadow_embree_wrong"] = int((~wrong).sum())
    names = ("shadow_mismatch", "shadow_edge")
    return {name: _fraction(counts.get(name), len(rays)) for name in names}, counts


def _fraction(count: int | None, total: int) -> float | None:
    return count / total if count is not None and total else None


def _bits(values: Floats) -> npt.NDArray[np.uint32]:
    return np.ascontiguousarray(values).view(np.uint32)


def _ray_bits(a: Rays, b: Rays) -> Flags:
    """Where two equally long lists of rays differ in any bit, (n,)."""
    parts = ((a.origin, b.origin), (a.direction, b.direction), (a.reach[:, None], b.reach[:, None]))
    differs: Flags = np.any([(_bits(x) != _bits(y)).any(axis=1) for x, y in parts], axis=0)
    return differs


def _shadow_pixels(a: Records, b: Records) -> dict[str, npt.NDArray[np.int64]]:
    """The pixels whose shadow rays, and whose answers, differ."""
    lights = 1 + max((int(r.shadow_light.max()) for r in (a, b) if len(r.shadow)), default=0)
    keys = [r.shadow_pixel.astype(np.int64) * lights + r.shadow_light for r in (a, b)]
    both, in_a, in_b = np.intersect1d(keys[0], keys[1], return_indices=True)
    moved = both[_ray_bits(a.shadow[in_a], b.shadow[in_b])]
    alone = np.setxor1d(keys[0], keys[1])
    answers = both[a.occluded[in_a] != b.occluded[in_b]]
    return {"shadow_rays": np.sort(np.concatenate([moved, alone])) // lights, "shadow": answers // lights}
