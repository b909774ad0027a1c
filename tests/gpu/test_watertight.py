"""The watertight intersector: exact signs, boxes that refuse none of its hits, and no hole in closed surfaces."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from closed_surfaces import FAR, plane, rays_to, rays_within, shared_edges, sphere
from hand_made import cubes
from hand_made import scene as made_of
from running import WALKS, bvh_of, catalogue_scene, context, prepared, ready, run

from renderer.glsl import flatten
from renderer.judge import referee
from renderer.judge.accuracy import judge
from renderer.judge.court import AGREE, EDGE, FALSE_HIT, Court, settle
from renderer.plan import Plan
from renderer.ray_plan import Answer, Question, make_ray_plan, read_answer
from renderer.records import Rays
from renderer.variant import Variant
from scenes.scene import Scene

Words = npt.NDArray[np.uint32]
Doubles = npt.NDArray[np.float64]

COUNT = 25_600
PRECISE = "#ifdef GL_EXT_gpu_shader5"
REAL = ("crytek-sponza", "conference", "happy-buddha", "stanford-dragon", "forest")
ORIGIN = np.zeros(3)


def vertices(scene: Scene, seed: int) -> Doubles:
    """Random vertices of the scene, (COUNT, 3)."""
    chosen = np.random.default_rng(seed).integers(len(scene.vertices), size=COUNT)
    return np.asarray(scene.vertices[chosen], np.float64)


def inner(centre: Doubles, radius: float, seed: int) -> Doubles:
    """Random points within a cube inside of a sphere, (COUNT, 3)."""
    return np.asarray(centre + radius * np.random.default_rng(seed).uniform(-0.5, 0.5, (COUNT, 3)))


def across(seed: int) -> Doubles:
    """Random points of the far plane, (COUNT, 3)."""
    rng = np.random.default_rng(seed)
    return np.asarray(FAR + np.column_stack([np.full(COUNT, 5.0), rng.uniform(-5.9, 5.9, (COUNT, 2))]))


@cache
def surface(name: str) -> Scene:
    match name.split():
        case ["plane", segments]:
            return plane(name, int(segments), FAR + np.array([5.0, -6.0, -6.0]), 12.0)
        case ["sphere", segments]:
            return sphere(name, int(segments), FAR, 2.0)
    return sphere(name, 32, ORIGIN, 1.0, jitter=0.02, seed=5)


CLOSED: dict[str, tuple[str, Callable[[Scene, int], Rays]]] = {
    "sphere 50, from inside": ("sphere 50", lambda _, seed: rays_within(FAR, 1.0, COUNT, seed)),
    "sphere 200, from inside": ("sphere 200", lambda _, seed: rays_within(FAR, 1.0, COUNT, seed)),
    "sphere 200, from around": ("sphere 200", lambda _, seed: rays_to(inner(FAR, 2.0, seed), FAR, 40.0, seed)),
    "sphere 50, vertices": ("sphere 50", lambda s, seed: rays_to(vertices(s, seed), FAR, 1.0, seed)),
    "sphere 50, edges": ("sphere 50", lambda s, seed: rays_to(shared_edges(s, COUNT, seed), FAR, 1.0, seed)),
    "plane 50": ("plane 50", lambda _, seed: rays_to(across(seed), FAR, 0.5, seed)),
    "plane 200": ("plane 200", lambda _, seed: rays_to(across(seed), FAR, 0.5, seed)),
    "perturbed": ("perturbed", lambda _, seed: rays_within(ORIGIN, 0.3, 4 * COUNT, seed)),
    "perturbed, vertices": ("perturbed", lambda s, seed: rays_to(vertices(s, seed), ORIGIN, 0.3, seed)),
    "perturbed, edges": ("perturbed", lambda s, seed: rays_to(shared_edges(s, COUNT, seed), ORIGIN, 0.3, seed)),
}
"""Embree's watertight set (verify, about FAR), and pbrt's vertex test (a perturbed sphere about the origin)."""


@cache
def given(case: str) -> tuple[Scene, Rays, referee.Verdict]:
    """A closed surface, rays that all hit it, and the referee's answer, which says so."""
    name, rays_of = CLOSED[case]
    scene = surface(name)
    rays = rays_of(scene, 1000 + list(CLOSED).index(case))
    return scene, rays, referee.closest(scene.triangles, rays, bvh_of(scene))


def ray_plan(scene: Scene, rays: Rays, variant: Variant) -> Plan:
    made = prepared(scene, variant, (8, 8))
    return make_ray_plan(scene, made.tree, made.packed, made.request, Question(rays))


def answer(plan: Plan, count: int) -> Answer:
    with ready(plan) as twin:
        return read_answer(plan, count, twin.collect())


@cache
def asked(case: str, variant: Variant) -> Answer:
    scene, rays, _ = given(case)
    return answer(ray_plan(scene, rays, variant), len(rays))


def edited(plan: Plan, old: str, new: str) -> Plan:
    """The plan with a part of its tracing text replaced."""
    programs = []
    for program in plan.programs:
        stages = {stage: text.replace(old, new) for stage, text in program.stages.items()}
        programs.append(replace(program, stages=stages))
    assert programs != list(plan.programs)
    return replace(plan, programs=tuple(programs))


def same_bits(a: Answer, b: Answer) -> bool:
    return a.hits.t.tobytes() == b.hits.t.tobytes() and a.hits.primitive.tobytes() == b.hits.primitive.tobytes()


# Signs


def corners_in_the_plane(seed: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """x and y of three corners each, (n, 3): most with two of them and the origin on a line but for the last digits."""
    rng = np.random.default_rng(seed)
    n = 40_000
    x, y = (rng.standard_normal((n, 3)) * 10.0 ** rng.integers(-9, 9, (n, 1)) for _ in range(2))
    scale = rng.uniform(0.1, 10.0, n)
    x[: n // 2, 1], y[: n // 2, 1] = (scale * x[:, 0])[: n // 2], (scale * y[:, 0])[: n // 2]
    x[: n // 4, 2], y[: n // 4, 2] = 2.0 * x[: n // 4, 1], 2.0 * y[: n // 4, 1]
    x[: n // 8, 0], y[: n // 8, 0] = x[: n // 8, 1], y[: n // 8, 1]
    return x.astype(np.float32), y.astype(np.float32)


def areas_on_device(text: str, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    made = context()
    program = made.compute_shader(text)
    buffers = [made.buffer(part.tobytes()) for part in (x, y, np.zeros_like(x))]
    for binding, buffer in enumerate(buffers):
        buffer.bind_to_storage_buffer(binding)
    if "budget_turns" in program:
        program["budget_turns"].write(struct.pack("<2I", 2, 2))
    program.run(len(x) // 64)
    made.finish()
    return np.frombuffer(buffers[2].read(), np.float32).reshape(-1, 3)


def areas_text() -> str:
    main = """layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly restrict buffer X { float xs[]; };
layout(std430, binding = 1) readonly restrict buffer Y { float ys[]; };
layout(std430, binding = 2) writeonly restrict buffer Found { float found[]; };
void main() {
    uint i = 3u * gl_GlobalInvocationID.x;
    vec3 areas = signed_areas(vec3(xs[i], xs[i + 1u], xs[i + 2u]), vec3(ys[i], ys[i + 1u], ys[i + 2u]));
    found[i] = areas.x;
    found[i + 1u] = areas.y;
    found[i + 2u] = areas.z;
}
"""
    return flatten({}, ["common_areas.glsl", main])


@pytest.mark.parametrize("precise", [True, False], ids=["precise", "barrier"])
@pytest.mark.parametrize("seed", [71, 72])
def test_signs_of_areas_are_exact(seed: int, precise: bool) -> None:
    x, y = corners_in_the_plane(seed)
    text = areas_text() if precise else areas_text().replace(PRECISE, "#ifdef NOWHERE")
    assert text.count(PRECISE) == (2 if precise else 0)
    found = np.sign(areas_on_device(text, x, y))
    p, q = ([[Fraction(float(value)) for value in row] for row in part] for part in (x, y))
    exact = [[px[c] * py[b] - py[c] * px[b] for c, b in ((2, 1), (0, 2), (1, 0))] for px, py in zip(p, q, strict=True)]
    signs = np.array([[(value > 0) - (value < 0) for value in row] for row in exact])
    np.testing.assert_array_equal(found, signs)
    rounded = x[:, [2, 0, 1]] * y[:, [1, 2, 0]] - y[:, [2, 0, 1]] * x[:, [1, 2, 0]]
    assert ((rounded == 0) & (signs != 0)).sum() > 1000
    assert (signs == 0).any()


@pytest.mark.parametrize("case", ["sphere 50, vertices", "perturbed, edges"])
def test_without_the_extension_hits_are_the_same_here(case: str) -> None:
    scene, rays, _ = given(case)
    plain = edited(ray_plan(scene, rays, Variant(intersector="watertight")), PRECISE, "#ifdef NOWHERE")
    assert same_bits(answer(plain, len(rays)), asked(case, Variant(intersector="watertight")))


# Boxes


def room(side: float) -> Scene:
    """A cube of 12 triangles, seen from within: all its edges lie in the faces of flat boxes."""
    return made_of(f"room {side}", cubes(1) * np.float32(side))


@cache
def at_boxes(seed: int) -> tuple[Scene, Rays]:
    """Rays to the edges of a large room from near its corner, where its far corners are rounded most."""
    scene = room(1e4)
    return scene, rays_to(shared_edges(scene, COUNT, seed), np.full(3, 3.7), 3.0, seed)


FEW = 6400
"""Rays that meet every triangle."""

FILTER = " && soonest <= latest"


@pytest.mark.parametrize("case", ["room", *(case for case in CLOSED if "200" not in case)])
def test_boxes_refuse_no_hit(case: str) -> None:
    """What is left out is the condition that the proof in ARCHITECTURE.md says is always true."""
    scene, rays = at_boxes(81) if case == "room" else given(case)[:2]
    rays = rays[np.arange(FEW)]
    plan = ray_plan(scene, rays, Variant("brute-force", "compute", intersector="watertight"))
    assert same_bits(answer(edited(plan, FILTER, ""), len(rays)), answer(plan, len(rays)))


def test_boxes_that_do_not_grow_would_refuse_some() -> None:
    scene, rays = at_boxes(81)
    plan = ray_plan(scene, rays, Variant("brute-force", "compute", intersector="watertight"))
    grown = "SHEAR_GROWTH * (reach + steep * shear_axes(reach).z) + SHEAR_ROUNDING * abs(ray_origin)"
    lost = (answer(edited(plan, grown, "vec3(0.0)"), len(rays)).hits.primitive == -1).sum()
    assert lost > 0
    assert (answer(plan, len(rays)).hits.primitive >= 0).all()


# Holes


CAST = [(case, "fragment") for case in CLOSED] + [("sphere 50, vertices", "compute"), ("perturbed", "compute")]


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize(("case", "method"), CAST)
def test_closed_surfaces_have_no_holes(case: str, method: str, traversal: str) -> None:
    scene, rays, truth = given(case)
    assert (truth.primitive >= 0).all()
    found = asked(case, Variant(traversal, method, intersector="watertight"))
    assert not found.cut.any()
    assert (found.hits.primitive >= 0).all()
    assert same_bits(found, asked(case, Variant(WALKS[0], intersector="watertight")))
    court = Court(scene.triangles, None, bvh_of(scene), True, "watertight")
    kinds = settle(court, rays, found.hits, truth, "watertight")
    assert set(np.unique(kinds)) <= {AGREE, EDGE}


@pytest.mark.parametrize("intersector", ["moller-trumbore", "baked"])
@pytest.mark.parametrize("case", CLOSED)
def test_what_others_lose_there_is_counted(case: str, intersector: str, capsys: pytest.CaptureFixture[str]) -> None:
    scene, rays, truth = given(case)
    found = asked(case, Variant(WALKS[0], intersector=intersector))
    court = Court(scene.triangles, None, bvh_of(scene), True, intersector)
    kinds = settle(court, rays, found.hits, truth, intersector)
    missed, edge = (found.hits.primitive == -1).sum(), (kinds == EDGE).sum()
    with capsys.disabled():
        print(f"\n{intersector}, {case}: {missed} of {len(rays)} miss, {edge} at edges, {(kinds > 0).sum()} differ")
    assert not (kinds == FALSE_HIT).any()
    loses = case.endswith(("vertices", "edges")) or (intersector == "baked" and "perturbed" not in case)
    assert (missed > 0) == loses


# Real scenes


@pytest.mark.parametrize("name", REAL)
def test_real_scenes_have_no_error_away_from_edges(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    scene = catalogue_scene(name)
    for intersector, share in (("watertight", 0.0), ("moller-trumbore", 1e-5)):
        records = run(scene, Variant(intersector=intersector), (256, 256)).records
        errors = judge(scene.triangles, records, None, bvh_of(scene), "referee", intersector)
        counts = errors.counts
        with capsys.disabled():
            print(
                f"\n{intersector}, {name}: {counts['edge']} of {counts['primary']} at edges, t {errors.t_rel_max:.1e}"
            )
        wrong = counts["false_hit"] + counts["false_miss"] + counts["wrong_primitive"]
        assert counts["hits"] > 0.1 * counts["primary"]
        assert wrong <= share * counts["primary"], counts
