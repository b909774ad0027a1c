"""The judge: planted errors are counted exactly, true ones settled by the referee, runs compared bit for bit."""

from __future__ import annotations

import os
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

from renderer.build.bvh import build_bvh
from renderer.build.tree import Bvh, SahCosts
from renderer.judge import referee
from renderer.judge.accuracy import answers_sha, identical, judge
from renderer.judge.oracle import Oracle
from renderer.records import RASTERISED, Flags, Floats, Hits, Ints, Rays, Records
from renderer.request import Check

SIDE = 64
LIGHT = np.array([2, 4, 3], np.float32)
DOWN = (0.0, 0.0, -1.0)


def records(primary: Rays, hits: Hits, shadow: Rays, occluded: Flags) -> Records:
    """Records with all rays in one row, and shadow rays in the order of the pixels that hit."""
    pixels = np.flatnonzero(hits.primitive != -1).astype(np.int32)
    n, s = len(primary), len(shadow)
    return Records(
        size=(n, 1),
        primary=primary,
        hits=hits,
        shadow=shadow,
        shadow_pixel=pixels,
        shadow_light=np.zeros(s, np.int32),
        occluded=occluded,
        primary_counts=np.zeros((n, 5), np.uint32),
        shadow_counts=np.zeros((s, 5), np.uint32),
        cut=np.zeros(n, np.bool_),
    )


def true_records(triangles: Floats, primary: Rays, bvh: Bvh | None) -> Records:
    """What a host without any error would report."""
    truth = referee.closest(triangles, primary, bvh)
    hits = Hits(truth.t.astype(np.float32), truth.primitive)
    hit = truth.primitive >= 0
    point = primary.origin[hit] + hits.t[hit, None] * primary.direction[hit]
    origin = (point + np.float32(1e-3) * (LIGHT - point)).astype(np.float32)
    shadow = Rays(origin, LIGHT - origin, np.ones(int(hit.sum()), np.float32))
    return records(primary, hits, shadow, referee.any_hit(triangles, shadow, bvh))


def pinhole(eye: tuple[float, float, float], half: float, side: int) -> Rays:
    """side x side rays from `eye` along -z, `half` the tangent of half the field of view."""
    at = ((np.arange(side) + 0.5) / side * 2 - 1) * half
    x, y = np.meshgrid(at, at)
    direction = np.stack([x.ravel(), y.ravel(), np.full(side * side, -1.0)], axis=1).astype(np.float32)
    origin = np.broadcast_to(np.array(eye, np.float32), direction.shape).copy()
    return Rays(origin, direction, np.full(side * side, np.inf, np.float32))


def tree(triangles: Floats) -> Bvh:
    return build_bvh(np.stack([triangles.min(axis=1), triangles.max(axis=1)], axis=1), SahCosts())


@cache
def ball() -> tuple[Floats, Oracle, Bvh, Records]:
    """A ball of 1280 triangles seen from outside, and what a host without error reports of it."""
    triangles = np.asarray(trimesh.creation.icosphere(subdivisions=3).triangles, np.float32)
    bvh = tree(triangles)
    return triangles, Oracle(triangles), bvh, true_records(triangles, pinhole((0.01, 0.02, 3), 0.5, SIDE), bvh)


def clear_hits(k: int) -> Ints:
    """k pixels whose hit is far from any edge, in random order."""
    triangles, _, _, truth = ball()
    margin = referee.edge_margin(triangles, truth.primary, truth.hits.primitive)
    pixels: Ints = np.random.default_rng(7).permutation(np.flatnonzero(margin > 100))[:k]
    return pixels


def with_primitive(pixels: npt.NDArray[np.integer], primitive: npt.ArrayLike, t: npt.ArrayLike) -> Records:
    """The ball's records with other answers in some pixels."""
    truth = ball()[3]
    hits = Hits(truth.hits.t.copy(), truth.hits.primitive.copy())
    hits.primitive[pixels], hits.t[pixels] = primitive, t
    return replace(truth, hits=hits)


def test_true_records_have_no_error() -> None:
    triangles, oracle, bvh, truth = ball()
    for judge_oracle in (oracle, None):
        errors = judge(triangles, truth, judge_oracle, bvh, "referee")
        assert errors.false_hit == errors.false_miss == errors.wrong_primitive == errors.edge == 0
        assert errors.shadow_mismatch == errors.shadow_edge == 0
        assert errors.t_ulp_max is not None
        assert errors.t_ulp_max <= 0.5
    assert errors.counts["hits"] == len(truth.shadow) > 1000
    assert errors.flip is None
    assert errors.raster_mismatch is None


@pytest.mark.parametrize("check", ["oracle", "referee"])
@pytest.mark.parametrize("k", [1, 17])
class TestPlanted:
    def counts(self, planted: Records, check: Check) -> dict[str, int]:
        """The counts of primary errors that are not 0."""
        triangles, oracle, bvh, _ = ball()
        errors = judge(triangles, planted, oracle, bvh, check)
        names = ("false_hit", "false_miss", "wrong_primitive", "edge")
        for name in names:
            fraction, count = getattr(errors, name), errors.counts.get(name)
            assert fraction == (None if count is None else count / SIDE**2)
        return {name: errors.counts[name] for name in names if errors.counts.get(name)}

    def test_false_misses(self, check: Check, k: int) -> None:
        assert self.counts(with_primitive(clear_hits(k), -1, np.inf), check) == {"false_miss": k}

    def test_false_hits(self, check: Check, k: int) -> None:
        missed = np.flatnonzero(ball()[3].hits.primitive < 0)[:k]
        assert self.counts(with_primitive(missed, np.arange(k), 2.5), check) == {"false_hit": k}

    def test_a_primitive_that_is_not_on_the_ray(self, check: Check, k: int) -> None:
        pixels = clear_hits(k)
        hits = ball()[3].hits
        other = (hits.primitive[pixels] + 640) % 1280
        assert self.counts(with_primitive(pixels, other, hits.t[pixels]), check) == {"wrong_primitive": k}

    def test_the_back_side_instead_of_the_front(self, check: Check, k: int) -> None:
        triangles, _, bvh, truth = ball()
        pixels = clear_hits(k)
        near = truth.primary[pixels]
        through = near.origin + near.direction * (truth.hits.t[pixels, None] + np.float32(0.01))
        back = referee.closest(triangles, Rays(through, near.direction, near.reach), bvh)
        far = truth.hits.t[pixels] + np.float32(0.01) + back.t.astype(np.float32)
        assert self.counts(with_primitive(pixels, back.primitive, far), check) == {"wrong_primitive": k}

    def test_shadow_flags(self, check: Check, k: int) -> None:
        triangles, oracle, bvh, truth = ball()
        flipped = truth.occluded.copy()
        # The light sees the ball's rim at a grazing angle; these points lie well away from it.
        normal = truth.shadow.origin / np.linalg.norm(truth.shadow.origin, axis=1, keepdims=True)
        clear = np.flatnonzero(np.abs(np.einsum("ij,ij->i", normal, truth.shadow.direction)) > 1)
        chosen = np.concatenate([clear[flipped[clear]][: k // 2], clear[~flipped[clear]][: k - k // 2]])
        flipped[chosen] ^= True
        errors = judge(triangles, replace(truth, occluded=flipped), oracle, bvh, check)
        assert errors.counts["shadow_mismatch"] == k
        assert errors.shadow_mismatch == k / len(truth.shadow)
        assert errors.shadow_edge == (None if check == "oracle" else 0)

    def test_t_alone(self, check: Check, k: int) -> None:
        triangles, oracle, bvh, truth = ball()
        pixels = clear_hits(k)
        planted = with_primitive(pixels, truth.hits.primitive[pixels], truth.hits.t[pixels] * np.float32(1.5))
        assert self.counts(planted, check) == {}
        errors = judge(triangles, planted, oracle, bvh, check)
        assert errors.t_rel_max == pytest.approx(0.5, abs=1e-6)
        assert errors.t_rel_p99 is not None
        assert (errors.t_rel_p99 < 1e-6) == (k == 1)


def square() -> tuple[Floats, Rays]:
    """A unit square of two triangles, and rays down onto its outer edge x = 1: one within a rounding, one clear."""
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)
    x = np.array([np.nextafter(np.float32(1), np.float32(0)), np.nextafter(np.float32(1), np.float32(2)), 0.9, 1.1])
    origin = np.stack([x, np.full(4, 0.5), np.ones(4)], axis=1).astype(np.float32)
    return corners, Rays(origin, np.tile(np.array(DOWN, np.float32), (4, 1)), np.full(4, np.inf, np.float32))


def test_errors_within_a_rounding_of_an_edge_are_counted_apart() -> None:
    triangles, primary = square()
    wrong = Hits(np.array([np.inf, 1, np.inf, 1], np.float32), np.array([-1, 0, -1, 0], np.int32))
    errors = judge(triangles, records(primary, wrong, primary[:2], np.array([False, True])), None, None, "referee")
    assert errors.counts["edge"] == 2
    assert (errors.false_miss, errors.false_hit, errors.edge, errors.wrong_primitive) == (0.25, 0.25, 0.5, 0)
    assert (errors.shadow_edge, errors.shadow_mismatch) == (1, 0)


def test_an_edge_excuses_no_miss_of_what_lies_behind_it() -> None:
    triangles, primary = square()
    wall = np.array([[[-9, -9, -1], [9, -9, -1], [0, 9, -1]]], np.float32)
    triangles = np.concatenate([triangles, wall])
    nothing = Hits(np.full(1, np.inf, np.float32), np.full(1, -1, np.int32))
    through = Hits(np.full(1, 2, np.float32), np.full(1, 2, np.int32))
    free = np.zeros(0, np.bool_)
    errors = judge(triangles, records(primary[:1], nothing, primary[:0], free), None, None, "referee")
    assert (errors.false_miss, errors.edge) == (1, 0)
    errors = judge(triangles, records(primary[:1], through, primary[:0], free), None, None, "referee")
    assert (errors.wrong_primitive, errors.edge) == (0, 1)
    assert errors.shadow_mismatch is None


def test_shared_edges_and_coincident_triangles_are_ties() -> None:
    triangles, _ = square()
    triangles = np.concatenate([triangles, triangles])
    at = np.array([[0.5, 0.5, 1], [0.75, 0.25, 1], [0.25, 0.75, 1]], np.float32)
    primary = Rays(at, np.tile(np.array(DOWN, np.float32), (3, 1)), np.full(3, np.inf, np.float32))
    for choice in ([1, 2, 1], [3, 0, 3], [0, 2, 3]):
        hits = Hits(np.ones(3, np.float32), np.array(choice, np.int32))
        for oracle in (Oracle(triangles), None):
            errors = judge(
                triangles, records(primary, hits, primary[:0], np.zeros(0, np.bool_)), oracle, None, "referee"
            )
            assert errors.false_hit == errors.false_miss == errors.wrong_primitive == errors.edge == 0


@pytest.mark.parametrize("check", ["oracle", "referee"])
def test_a_coplanar_triangle_elsewhere_is_no_tie(check: Check) -> None:
    triangles, primary = square()
    at = Rays(np.array([[0.75, 0.25, 1]], np.float32), primary.direction[:1], primary.reach[:1])
    wrong = Hits(np.ones(1, np.float32), np.ones(1, np.int32))
    errors = judge(triangles, records(at, wrong, at[:0], np.zeros(0, np.bool_)), Oracle(triangles), None, check)
    assert (errors.wrong_primitive, errors.false_hit, errors.false_miss) == (1, 0, 0)


def test_the_referee_overrules_embree() -> None:
    # Embree counts a hit at t = 0; the interval of a ray is open there.
    triangles, primary = square()
    start = Rays(np.array([[0.75, 0.25, 0]], np.float32), primary.direction[:1], primary.reach[:1])
    miss = Hits(np.full(1, np.inf, np.float32), np.full(1, -1, np.int32))
    errors = judge(triangles, records(start, miss, start, np.zeros(1, np.bool_)), Oracle(triangles), None, "referee")
    assert (errors.false_miss, errors.edge, errors.shadow_mismatch, errors.shadow_edge) == (0, 0, 0, 0)
    assert (errors.counts["embree_wrong"], errors.counts["shadow_embree_wrong"]) == (1, 1)


def test_a_rasterised_image_is_compared_by_hit_or_miss_alone() -> None:
    triangles, oracle, bvh, truth = ball()
    raster = np.where(truth.hits.primitive >= 0, RASTERISED, -1).astype(np.int32)
    raster[clear_hits(5)] = -1
    raster[np.flatnonzero(truth.hits.primitive < 0)[:2]] = RASTERISED
    errors = judge(triangles, replace(truth, hits=Hits(truth.hits.t, raster), rasterised=True), oracle, bvh, "referee")
    assert errors.raster_mismatch == 7 / SIDE**2
    assert errors.false_hit is errors.false_miss is errors.wrong_primitive is errors.edge is errors.t_rel_max is None
    assert errors.shadow_mismatch == 0


def test_what_is_not_measured_is_none() -> None:
    triangles, oracle, bvh, truth = ball()
    unmeasured = judge(triangles, truth, oracle, bvh, "none")
    figures = asdict(unmeasured)
    assert figures.pop("counts") == {}
    assert set(figures.values()) == {None}
    raw = judge(triangles, truth, oracle, bvh, "oracle")
    assert raw.edge is raw.shadow_edge is None
    assert raw.false_hit == 0


def test_what_cannot_be_judged_is_refused() -> None:
    triangles, oracle, bvh, truth = ball()
    with pytest.raises(ValueError, match="needs an oracle"):
        judge(triangles, truth, None, bvh, "oracle")
    with pytest.raises(ValueError, match="choose one of none, oracle, referee, image"):
        judge(triangles, truth, oracle, bvh, "embree")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="their own scene"):
        judge(triangles[:9], truth, oracle, bvh, "oracle")


def test_every_ray_misses() -> None:
    triangles, oracle, bvh, _ = ball()
    away = pinhole((0, 0, 9), 0.5, 8)
    away = Rays(away.origin, -away.direction, away.reach)
    misses = Hits(np.full(64, np.inf, np.float32), np.full(64, -1, np.int32))
    errors = judge(triangles, records(away, misses, away[:0], np.zeros(0, np.bool_)), oracle, bvh, "referee")
    assert errors.false_hit == errors.false_miss == errors.edge == 0
    assert errors.t_rel_max is errors.t_rel_p99 is errors.t_ulp_max is errors.shadow_mismatch is None


@pytest.mark.parametrize("seed", [51, 52])
def test_embree_on_a_random_soup_is_right_away_from_edges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    soup = (rng.normal(size=(4000, 1, 3)) + rng.normal(size=(4000, 3, 3)) * 0.1).astype(np.float32)
    origin = (rng.normal(size=(20_000, 3)) * 2).astype(np.float32)
    direction = (soup[rng.integers(0, 4000, 20_000), rng.integers(0, 3, 20_000)] - origin).astype(np.float32)
    primary = Rays(origin, direction, np.full(20_000, 2, np.float32))
    oracle = Oracle(soup)
    found = records(primary, oracle.closest(primary), primary[:0], np.zeros(0, np.bool_))
    errors = judge(soup, found, None, tree(soup), "referee")
    print(f"seed {seed}: {errors.counts}, t_rel_max {errors.t_rel_max}")
    assert errors.false_hit == errors.false_miss == errors.wrong_primitive == 0
    assert errors.counts["hits"] > 1000
    # Rays aimed at vertices: most disagreements must have been edges.
    assert errors.counts["edge"] > 0


def float32_closest(triangles: Floats, rays: Rays) -> Hits:
    """Moller-Trumbore in float32 against every triangle, smallest t and then smallest primitive."""
    o, d = rays.origin, rays.direction
    t, primitive = np.full(len(rays), np.inf, np.float32), np.full(len(rays), -1, np.int32)
    for i, (a, b, c) in enumerate(triangles):
        e1, e2, s = b - a, c - a, o - a
        p, q = np.cross(d, e2), np.cross(s, e1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            scale = np.float32(1) / (p @ e1)
            u, v, at = (s * p).sum(axis=1) * scale, (d * q).sum(axis=1) * scale, (q @ e2) * scale
            better = (u >= 0) & (v >= 0) & (u + v <= 1) & (at > 0) & (at <= rays.reach) & (at < t)
        t[better], primitive[better] = at[better], i
    return Hits(t, primitive)


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.95), (0.011, -0.007, 0.93)])
def test_float32_in_a_closed_box_errs_at_edges_alone(eye: tuple[float, float, float]) -> None:
    box = np.asarray(trimesh.creation.box((2, 2, 2)).triangles, np.float32)
    box = (box @ np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]])).astype(np.float32)
    primary = pinhole(eye, 1.0, 256)
    found = float32_closest(box, primary)
    for oracle in (Oracle(box), None):
        errors = judge(box, records(primary, found, primary[:0], np.zeros(0, np.bool_)), oracle, None, "referee")
        print(f"eye {eye}: {errors.counts}, t_ulp_max {errors.t_ulp_max}")
        assert errors.false_hit == errors.false_miss == errors.wrong_primitive == 0
        assert errors.edge is not None
        assert errors.edge < 1e-2


def scene(name: str) -> Floats:
    """A real scene's triangles, (m, 3, 3) float32."""
    for folder in os.environ.get("RAYFARM_SCENES", "").split(os.pathsep):
        path = Path(folder) / name
        if folder and path.is_file():
            mesh = trimesh.load_mesh(path, process=False)
            return np.ascontiguousarray(mesh.vertices.astype(np.float32)[mesh.faces])
    return pytest.skip(f"RAYFARM_SCENES names no folder with {name}")


def test_embree_and_the_referee_agree_on_the_bunny() -> None:
    triangles = scene("bunny_zipper_69k.ply")
    bvh = tree(triangles)
    oracle = Oracle(triangles)
    middle = triangles.reshape(-1, 3).mean(axis=0)
    primary = pinhole((float(middle[0]), float(middle[1]), float(middle[2]) + 0.35), 0.25, 256)
    truth = true_records(triangles, primary, bvh)
    found = replace(truth, hits=oracle.closest(primary), occluded=oracle.occluded(truth.shadow))
    errors = judge(triangles, found, None, bvh, "referee")
    print(errors)
    assert errors.counts["hits"] > 10_000
    assert errors.false_hit == errors.false_miss == errors.wrong_primitive == 0
    assert errors.shadow_mismatch == 0


class TestIdentical:
    def test_a_run_is_identical_to_itself(self) -> None:
        truth = ball()[3]
        difference = identical(truth, replace(truth, hits=Hits(truth.hits.t.copy(), truth.hits.primitive.copy())))
        assert difference.same
        assert difference.first == {}

    def test_one_bit_of_t(self) -> None:
        truth = ball()[3]
        pixels = np.sort(clear_hits(3))
        nudged = np.nextafter(truth.hits.t[pixels], np.float32(0))
        difference = identical(truth, with_primitive(pixels, truth.hits.primitive[pixels], nudged))
        assert (difference.t, difference.hit, difference.primitive, difference.rays) == (3, 0, 0, 0)
        assert difference.first == {"t": tuple(pixels.tolist())}

    def test_a_digest_tells_them_apart_as_well(self) -> None:
        ours = ball()[3]
        t = ours.hits.t.copy()
        at = int(np.flatnonzero(np.isfinite(t))[0])
        t[at] = np.nextafter(t[at], np.float32(0))
        moved = ours.primary.direction.copy()
        moved[0, 0] = np.nextafter(moved[0, 0], np.float32(9))
        others = [
            replace(ours, hits=Hits(t, ours.hits.primitive)),
            replace(ours, occluded=~ours.occluded),
            replace(ours, primary=replace(ours.primary, direction=moved)),
        ]
        assert len({answers_sha(one) for one in (ours, *others)}) == 4
        assert answers_sha(replace(ours, hits=Hits(ours.hits.t.copy(), ours.hits.primitive.copy()))) == answers_sha(
            ours
        )

    def test_hits_primitives_and_rays(self) -> None:
        truth = ball()[3]
        pixels = clear_hits(2)
        difference = identical(truth, with_primitive(pixels[:1], -1, np.inf))
        assert (difference.hit, difference.primitive, difference.t) == (1, 1, 1)
        difference = identical(truth, with_primitive(pixels, 0, truth.hits.t[pixels]))
        assert (difference.hit, difference.primitive, difference.t) == (0, 2, 0)
        turned = Rays(truth.primary.origin, truth.primary.direction.copy(), truth.primary.reach)
        turned.direction[9, 1] = -turned.direction[9, 1]
        difference = identical(truth, replace(truth, primary=turned))
        assert (difference.rays, difference.first) == (1, {"rays": (9,)})

    def test_shadow_rays_are_matched_by_pixel_and_light(self) -> None:
        truth = ball()[3]
        keep = np.arange(len(truth.shadow)) != 4
        order = np.flatnonzero(keep)[::-1]
        other = replace(
            truth,
            shadow=truth.shadow[order],
            shadow_pixel=truth.shadow_pixel[order],
            shadow_light=truth.shadow_light[order],
            occluded=truth.occluded[order].copy(),
        )
        other.occluded[0] ^= True
        difference = identical(truth, other)
        assert (difference.shadow_rays, difference.shadow, difference.t) == (1, 1, 0)
        first = {"shadow_rays": (int(truth.shadow_pixel[4]),), "shadow": (int(truth.shadow_pixel[-1]),)}
        assert difference.first == first

    def test_two_sizes_are_refused(self) -> None:
        truth = ball()[3]
        with pytest.raises(ValueError, match="at the same size"):
            identical(truth, replace(truth, size=(SIDE, SIDE)))
