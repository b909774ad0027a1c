"""The error of a run: hit records against the oracle, and the referee's verdict wherever the two disagree.

`renderer.judge.court` says what is the same hit and what an error is called. Where the oracle agrees with us the
referee is not asked.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh
from renderer.judge import referee
from renderer.judge.court import (
    AGREE,
    EDGE,
    EMBREE,
    FALSE_HIT,
    FALSE_MISS,
    WRONG_PRIMITIVE,
    Court,
    Kinds,
    hits_of,
    raw_kinds,
    settle,
    ties,
)
from renderer.judge.oracle import Oracle
from renderer.judge.referee import Verdict
from renderer.judge.shadow_start import judge_starts
from renderer.records import Flags, Floats, Hits, Rays, Records
from renderer.request import CHECKS, Check
from scenes.scene import Point


@dataclass(frozen=True)
class Errors:
    """The error of a run; None is what was not measured, for instance everything with check "none".

    `false_hit`, `false_miss`, `edge`, `wrong_primitive`, and for a hybrid plan `raster_mismatch` (hit or miss against
    the rays), are fractions of the primary rays; `shadow_mismatch` and `shadow_edge` of the shadow rays, and so are
    `shadow_self_hit` and `shadow_leak`, which `renderer.judge.shadow_start` tells beside the exact rays. `t_rel_p99`,
    `t_rel_max` and `t_ulp_max` (float32 ulps) compare t with the float64 t of the same primitive's plane along the
    same ray. `flip` and `psnr` (dB) are the picture's figures and not filled in here. `counts` are the numbers of
    rays behind the fractions, and who was wrong where the oracle and we disagreed on more than a tie: `embree_wrong`
    (of those `embree_edge` where float32 may err), `ours_wrong`, `both_wrong`; `shadow_embree_wrong`,
    `shadow_ours_wrong`.
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
    shadow_self_hit: float | None = None
    shadow_leak: float | None = None
    raster_mismatch: float | None = None
    flip: float | None = None
    psnr: float | None = None
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


def judge(
    triangles: Floats,
    records: Records,
    oracle: Oracle | None,
    bvh: Bvh | None,
    check: Check,
    intersector: str = "moller-trumbore",
    lights: Sequence[Point] | None = None,
) -> Errors:
    """Judge `records` of a scene with `triangles` (m, 3, 3) float32.

    "oracle" counts raw disagreements and leaves `edge` None; "referee" settles them in float64, along `bvh` or, without
    one, against every triangle, and so does "image". Then the oracle may be None: the referee is asked for every ray.
    `intersector` is the test that made the records: its float32 bound says what is an edge. Where shadow rays start is
    judged by the referee alone, if `lights` says where they go, and not where a rasteriser found the surface.
    """
    if check == "none":
        return Errors()
    if check not in CHECKS:
        raise ValueError(f'Check "{check}" is unknown; choose one of {", ".join(CHECKS)}.')
    if oracle is None and check == "oracle":
        raise ValueError('Check "oracle" needs an oracle; give one, or choose referee.')
    if len(triangles) <= int(records.hits.primitive.max(initial=-1)):
        raise ValueError("A hit names a triangle that the scene has not; judge records with their own scene.")
    court = Court(triangles, oracle, bvh, check != "oracle", intersector)
    figures, counts = _raster(court, records) if records.rasterised else _primary(court, records)
    shadow_figures, shadow_counts = _shadow(court, records)
    start_figures, start_counts = _starts(court, records, lights)
    counts |= shadow_counts | start_counts
    return Errors(**figures, **shadow_figures, **start_figures, counts=counts)


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


def answers_sha(records: Records) -> str:
    """A sha256 over what `identical` compares, so that stored results can be told alike: rays, hits and shadows."""
    digest = hashlib.sha256()
    rays = (records.primary.origin, records.primary.direction, records.shadow.origin, records.shadow.direction)
    for part in (*rays, records.hits.primitive, records.hits.t, records.shadow_pixel, records.occluded):
        digest.update(np.ascontiguousarray(part).data)
    return digest.hexdigest()


_Figures = tuple[dict[str, float | None], dict[str, int]]


def _primary(court: Court, records: Records) -> _Figures:
    rays, hits = records.primary, records.hits
    kinds, settled = _kinds(court, rays, hits)
    counts = {
        "primary": len(rays),
        "hits": int((hits.primitive >= 0).sum()),
        "false_hit": int((kinds == FALSE_HIT).sum()),
        "false_miss": int((kinds == FALSE_MISS).sum()),
        "wrong_primitive": int((kinds == WRONG_PRIMITIVE).sum()),
    }
    if court.referee:
        counts |= {"edge": int((kinds == EDGE).sum())} | settled
    names = ("false_hit", "false_miss", "wrong_primitive", "edge")
    figures = {name: _fraction(counts.get(name), len(rays)) for name in names}
    return figures | _t_errors(court.triangles, rays, hits), counts


def _kinds(court: Court, rays: Rays, hits: Hits) -> tuple[Kinds, dict[str, int]]:
    """The kind of each ray's answer, (n,), and for whom the referee settled the disagreements with the oracle."""
    if court.oracle is None:
        return settle(court, rays, hits, court.truth(rays), court.intersector), {}
    kinds = np.full(len(rays), AGREE, np.int8)
    found = court.oracle.closest(rays)
    suspects = np.flatnonzero(found.primitive != hits.primitive)
    theirs = Verdict(found.t[suspects].astype(np.float64), found.primitive[suspects])
    suspects = suspects[~ties(court, rays[suspects], hits.primitive[suspects], theirs, court.intersector)]
    disputed, mine, embree = rays[suspects], hits_of(hits, suspects), hits_of(found, suspects)
    if not court.referee:
        kinds[suspects] = raw_kinds(mine.primitive, embree.primitive)
        return kinds, {}
    truth = court.truth(disputed)
    kinds[suspects] = settle(court, disputed, mine, truth, court.intersector)
    return kinds, _settled(kinds[suspects], settle(court, disputed, embree, truth, EMBREE))


def _settled(ours: Kinds, embree: Kinds) -> dict[str, int]:
    """How many disagreements went against Embree, against us, and against both; two right answers are a tie."""
    right, wrong = ours == AGREE, embree != AGREE
    return {
        "embree_wrong": int((right & wrong).sum()),
        "embree_edge": int((right & (embree == EDGE)).sum()),
        "ours_wrong": int((~right & ~wrong).sum()),
        "both_wrong": int((~right & wrong).sum()),
    }


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


def _raster(court: Court, records: Records) -> _Figures:
    """A rasteriser's visibility against the rays': only hit or miss can be compared."""
    rays, hit = records.primary, records.hits.primitive != -1
    truth = _visible(court, rays, hit)
    mismatches = int((truth != hit).sum())
    counts = {"primary": len(rays), "hits": int(hit.sum()), "raster_mismatch": mismatches}
    return {"raster_mismatch": _fraction(mismatches, len(rays))}, counts


def _visible(court: Court, rays: Rays, hit: Flags) -> Flags:
    """Whether each ray hits anything, by the oracle and, where it contradicts `hit`, the referee."""
    answer = court.oracle.closest(rays).primitive >= 0 if court.oracle is not None else ~hit
    suspects = np.flatnonzero(answer != hit)
    if court.referee:
        answer[suspects] = court.occluded(rays[suspects])
    return answer


def _shadow(court: Court, records: Records) -> _Figures:
    rays, mine = records.shadow, records.occluded
    answer = court.oracle.occluded(rays) if court.oracle is not None else ~mine
    suspects = np.flatnonzero(answer != mine)
    counts = {"shadow": len(rays), "shadow_mismatch": len(suspects)}
    if court.referee:
        disputed, ours = rays[suspects], mine[suspects]
        wrong = court.occluded(disputed) != ours
        rest, occluded = disputed[wrong], ours[wrong]
        # Occluded is within the bound if a grown triangle occludes; free, if no shrunk one does.
        edge = np.where(occluded, court.occluded(rest, 1.0), ~court.occluded(rest, -1.0))
        counts["shadow_mismatch"], counts["shadow_edge"] = int((~edge).sum()), int(edge.sum())
        if court.oracle is not None:
            counts |= {"shadow_embree_wrong": int((~wrong).sum()), "shadow_ours_wrong": int(wrong.sum())}
    names = ("shadow_mismatch", "shadow_edge")
    return {name: _fraction(counts.get(name), len(rays)) for name in names}, counts


def _starts(court: Court, records: Records, lights: Sequence[Point] | None) -> _Figures:
    if lights is None or not court.referee or records.rasterised:
        return {}, {}
    counts = {f"shadow_{name}": count for name, count in asdict(judge_starts(court, records, lights)).items()}
    return {n: _fraction(counts[n], len(records.shadow)) for n in ("shadow_self_hit", "shadow_leak")}, counts


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
