"""Shadow rays with the bounded offset start beside their triangle, on the eye's side, and neither hit it nor leak."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hand_made import SCENES, cubes, moved, scene, soup, wall
from running import WALKS, bvh_of, catalogue_scene, prepared, ready, run, tree_of

from renderer.judge.accuracy import Errors, identical, judge
from renderer.ray_plan import Answer, Question, make_ray_plan, read_answer
from renderer.records import Floats, Hits, Rays
from renderer.variant import AXES, Variant
from scenes.scene import Point, Scene

RAYS = 10_000
FAR = float(np.finfo(np.float32).max)
REAL = ("cornell-box", "crytek-sponza", "forest")


def scattered(seed: int) -> Floats:
    """Triangles with coordinates of 10^-8 to 10^8, every one of its own size (pbrt's reintersection test)."""
    rng = np.random.default_rng(seed)
    sizes = 10 ** rng.uniform(-8, 8, (600, 3, 3))
    return np.asarray(sizes * rng.choice([-1.0, 1.0], sizes.shape), np.float32)


def scaled(seed: int) -> Floats:
    """Well-shaped triangles of sizes from 10^-8 to 10^8, as far from the origin or much farther."""
    rng = np.random.default_rng(seed)
    size, place = 10 ** rng.uniform(-8, 8, (600, 1, 1)), 10 ** rng.uniform(-8, 8, (600, 1, 1))
    return np.asarray(place * rng.normal(size=(600, 1, 3)) + size * rng.normal(size=(600, 3, 3)), np.float32)


def slivers(seed: int) -> Floats:
    """Triangles 10^-5 to 10^-1 times as wide as they are long."""
    rng = np.random.default_rng(seed)
    corner, along, across = (rng.normal(size=(600, 1, 3)) for _ in range(3))
    where = np.stack([[0.0, 0.0], [1.0, 0.0], [0.4, 1.0]])[None]
    width = 10 ** rng.uniform(-5, -1, (600, 1, 1))
    return np.asarray(corner + where[..., :1] * along + width * where[..., 1:] * across, np.float32)


SHAPES: dict[str, Callable[[int], Floats]] = {
    "scattered": scattered,
    "scaled": scaled,
    "slivers": slivers,
    "soup": lambda seed: soup(600, seed),
}


@pytest.mark.parametrize("intersector", AXES["intersector"])
@pytest.mark.parametrize("shape", SHAPES)
def test_rays_that_leave_a_triangle_start_on_the_right_side_and_do_not_hit_it(shape: str, intersector: str) -> None:
    made = scene(f"{shape} seed 3", SHAPES[shape](3))
    first, primitive, spawned = leave(made, Variant("bvh-stack", "compute", intersector=intersector, offset="bounded"))
    assert len(primitive) > 0.9 * RAYS
    a, b, c = np.moveaxis(exact(made.triangles[primitive]), 1, 0)
    normal = cross(b - a, c - a)
    side = dot(normal, exact(spawned.rays.origin) - a)
    eye = -dot(normal, exact(first.direction))
    grazing = np.abs(eye.astype(np.float64)) < 1e-6 * spans(normal) * spans(exact(first.direction))
    assert grazing.sum() < 1e-3 * RAYS
    assert not (~grazing & (signs(side) != signs(eye))).any()
    leaving = signs(dot(normal, exact(spawned.rays.direction))) == signs(side)
    assert leaving.sum() > 0.4 * RAYS
    assert not (leaving & (spawned.hits.primitive == primitive)).any()


def test_the_constant_offset_hits_its_own_triangle_far_from_the_origin() -> None:
    """10^-4 of the diagonal is less than float32 resolves there: the test above can fail."""
    made = moved("far seed 5", 1.0, (1e5, -1e5, 1e5))
    found = {}
    for offset in AXES["offset"]:
        first, primitive, spawned = leave(made, Variant("bvh-stack", "compute", offset=offset))
        assert len(primitive) > 0.5 * RAYS
        a, b, c = np.moveaxis(made.triangles[primitive].astype(np.float64), 1, 0)
        normal = np.cross(b - a, c - a)
        away = (normal * first.direction).sum(axis=1) * (normal * spawned.rays.direction).sum(axis=1) < 0
        found[offset] = int((away & (spawned.hits.primitive == primitive)).sum())
    assert found["bounded"] == 0
    assert found["constant"] > 0.1 * RAYS


def leave(made: Scene, variant: Variant, seed: int = 9) -> tuple[Rays, npt.NDArray[np.int32], Answer]:
    """Rays that hit something, what they hit, and what rays in random directions found that start there."""
    rng = np.random.default_rng(seed)
    corners = made.triangles[rng.integers(0, len(made.faces), RAYS)].astype(np.float64)
    target = (corners * rng.dirichlet([1, 1, 1], RAYS)[..., None]).sum(axis=1)
    size = np.ptp(corners, axis=1).max(axis=1, keepdims=True)
    origin = (target + size * 10 ** rng.uniform(-1, 1, (RAYS, 1)) * unit(rng.normal(size=(RAYS, 3)))).astype(np.float32)
    way = target - origin
    there = np.flatnonzero(np.abs(way).max(axis=1) > 0)
    rays = Rays(origin[there], unit(way[there]).astype(np.float32), np.full(len(there), FAR, np.float32))
    closest = ask(made, variant, Question(rays))
    hit = np.flatnonzero(closest.hits.primitive >= 0)
    start = Hits(closest.hits.t[hit], closest.hits.primitive[hit])
    on = Rays(origin[:0], unit(rng.normal(size=(len(hit), 3))).astype(np.float32), np.full(len(hit), FAR, np.float32))
    question = Question(rays[hit], start=start, slot=closest.slot[hit], spawned=on)
    return rays[hit], start.primitive, ask(made, variant, question)


def ask(made: Scene, variant: Variant, question: Question) -> Answer:
    laid = prepared(made, variant, (8, 8))
    plan = make_ray_plan(made, tree_of(made, "bvh"), laid.packed, laid.request, question)
    with ready(plan) as twin:
        return read_answer(plan, len(question.rays), twin.collect())


def unit(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def exact(values: Floats) -> npt.NDArray[np.object_]:
    """float32 as whole numbers of its smallest step, which Python adds and multiplies without error."""
    whole = np.vectorize(lambda value: int(math.ldexp(value, 149)), otypes=[object])
    return np.asarray(whole(values.astype(np.float64)))


def cross(a: npt.NDArray[np.object_], b: npt.NDArray[np.object_]) -> npt.NDArray[np.object_]:
    return np.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)


def dot(a: npt.NDArray[np.object_], b: npt.NDArray[np.object_]) -> npt.NDArray[np.object_]:
    return np.asarray((a * b).sum(axis=1))


def signs(values: npt.NDArray[np.object_]) -> npt.NDArray[np.int64]:
    return (values > 0).astype(np.int64) - (values < 0).astype(np.int64)


def spans(vectors: npt.NDArray[np.object_]) -> npt.NDArray[np.float64]:
    return np.asarray(np.abs(vectors).max(axis=1).astype(np.float64))


@pytest.mark.parametrize("name", SCENES)
def test_the_offset_changes_no_primary_ray(name: str) -> None:
    made = SCENES[name]()
    constant, bounded = (run(made, Variant(offset=offset), (33, 31)).records for offset in AXES["offset"])
    found = identical(constant, bounded)
    assert found.rays == found.hit == found.primitive == found.t == 0


@pytest.mark.parametrize("name", ["soup seed 12", "two lights", "inside a cube", "light on the surface"])
def test_bounded_shadows_are_the_same_bits_for_every_walk_and_method(name: str) -> None:
    made = SCENES[name]()
    brute = run(made, Variant("brute-force", offset="bounded"), (33, 31)).records
    for walk in WALKS:
        for method in ("fragment", "compute"):
            assert identical(brute, run(made, Variant(walk, method, offset="bounded"), (33, 31)).records).same


def test_a_wall_nearer_than_the_constant_offset_stops_bounded_rays_only() -> None:
    """The eye is in a gap of 2 10^-5 of the diagonal, which the constant offset passes."""
    gap = scene("gap", np.concatenate([wall(0.0), wall(3e-5)]), (0.4, 0.5, 1.5e-5), (0.4, 0.5, 0.0), 90.0)
    constant, bounded = starts(gap, "constant"), starts(gap, "bounded")
    assert constant.shadow_leak == 1.0
    assert bounded.shadow_leak == bounded.shadow_self_hit == bounded.counts["shadow_start_edge"] == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    "made", [scene("cubes", cubes(3), (9.0, 7.0, 8.0), (2.0, 2.0, 2.0), lights=((9.0, 9.0, 2.0),))]
)
def test_bounded_starts_are_right_at_every_scale(made: Scene, scale: float) -> None:
    found = starts(resized(made, scale), "bounded")
    assert found.shadow_leak == found.shadow_self_hit == 0
    assert found.counts["shadow_blocked"] == 0


@pytest.mark.parametrize("intersector", ["moller-trumbore", "watertight"])
@pytest.mark.parametrize("name", REAL)
def test_bounded_starts_are_right_on_real_scenes(name: str, intersector: str) -> None:
    made = catalogue_scene(name)
    constant = starts(made, "constant", (256, 256), intersector)
    for scale in (1e-3, 1.0, 1e3) if intersector == "moller-trumbore" else (1.0,):
        bounded = starts(resized(made, scale), "bounded", (256, 256), intersector)
        assert bounded.shadow_leak == bounded.shadow_self_hit == 0
        assert bounded.counts["shadow_start_edge"] <= 16, bounded.counts
    assert constant.shadow_leak is not None
    assert constant.shadow_leak > 1e-4


def starts(made: Scene, offset: str, size: tuple[int, int] = (65, 63), intersector: str = "moller-trumbore") -> Errors:
    records = run(made, Variant(offset=offset, intersector=intersector), size).records
    return judge(made.triangles, records, None, bvh_of(made), "referee", intersector, made.lights)


def resized(made: Scene, scale: float) -> Scene:
    """A scene in other units."""

    def place(point: Point) -> Point:
        return point[0] * scale, point[1] * scale, point[2] * scale

    camera = replace(made.camera, eye=place(made.camera.eye), target=place(made.camera.target))
    vertices = (made.vertices * np.float64(scale)).astype(np.float32)
    lights = tuple(place(light) for light in made.lights)
    return replace(made, name=f"{made.name} x {scale}", vertices=vertices, camera=camera, lights=lights, source="")
