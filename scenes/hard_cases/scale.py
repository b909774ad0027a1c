"""Scenes far away, tiny, huge, and both at once."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.hard_cases.case import Family, HardCase, Random, case
from scenes.hard_cases.shapes import about, cube, directions, points_on, soup, sphere, square, unit

GODOT = "godot pull request 53844 (an epsilon lost triangles)"


def placed(random: Random, count: int, scale: float, offset: float) -> HardCase:
    """A soup scaled, then moved by `offset` on every axis; rays from around it at points of it."""
    triangles = (soup(random, 500) * scale + offset).astype(np.float32).astype(np.float64)
    goal, _ = points_on(random, triangles, count)
    origin = goal + 3.0 * scale * directions(random, count)
    return case(triangles, origin, unit(goal - origin))


def stadium(random: Random, count: int) -> HardCase:
    """A sphere of 0.1 on the floor of a bowl of 10,000; rays from the stands at the sphere, and back."""
    small = sphere(20, np.array([30.0, 0.1, -20.0]), 0.1)
    bowl = sphere(12, 0.0, 1e4)
    floor = (square(4) - [2.0, 2.0, 0.0])[:, :, [0, 2, 1]] * 5e3
    triangles = np.concatenate([small, bowl, floor])
    goal, _ = points_on(random, small, count)
    stands = unit(cube(random, count) * [1.0, 0.4, 1.0] + [0.0, 0.6, 0.0]) * 9e3
    outward = random.random((count, 1)) < 0.3
    origin = np.where(outward, [30.0, 0.1, -20.0], stands).astype(np.float32)
    return case(triangles, origin, unit(np.where(outward, stands, goal) - origin))


def huge_flat_box(random: Random, count: int) -> HardCase:
    """5.9e11 wide and 1.2e5 high; rays from just above its lid, where Embree reported its bottom."""
    side, height = 5.890750e11, 1.2e5
    lid, floor = square(1, 1.0), square(1, 0.0)
    triangles = np.concatenate([lid, floor]) * [side, side, height] - [side / 2, side / 2, 0.0]
    origin = np.concatenate(
        [random.uniform(-1, 1, (count, 2)) * 10.0 ** random.uniform(0, 11, (count, 1)), np.full((count, 1), 120500.0)],
        axis=1,
    )
    way = np.concatenate([0.2 * cube(random, count)[:, :2], -np.ones((count, 1))], axis=1)
    return case(triangles, origin, unit(way))


def far_eye(random: Random, count: int) -> HardCase:
    """A unit soup seen from 1e3 to 1e7 away."""
    triangles = soup(random, 500)
    goal, _ = points_on(random, triangles, count)
    origin = (goal + directions(random, count) * 10.0 ** random.uniform(3, 7, (count, 1))).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def all_sizes(random: Random, count: int) -> HardCase:
    """Triangles of every size from 1e-8 to 1e8 about the origin, rays that start among them."""
    size = 10.0 ** random.uniform(-8, 8, (600, 1, 1))
    triangles = size * (random.uniform(-1, 1, (600, 1, 3)) + random.uniform(-1, 1, (600, 3, 3)))
    goal, _ = points_on(random, triangles, count)
    origin = (cube(random, count) * 10.0 ** random.uniform(-8, 8, (count, 1))).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def grazing(random: Random, count: int) -> HardCase:
    """A grid of 32 x 32, and rays 1e-2 to 1e-7 of their way above it, some dipping in and some not."""
    goal = np.concatenate([random.uniform(0, 32, (count, 2)), np.zeros((count, 1))], axis=1)
    turn = random.uniform(0, 2 * np.pi, (count, 1))
    steep = 10.0 ** random.uniform(-7, -2, (count, 1)) * random.choice([-1.0, 1.0], (count, 1))
    way = np.concatenate([np.cos(turn), np.sin(turn), -np.abs(steep)], axis=1)
    origin = (goal - 20.0 * way * [1.0, 1.0, 1.0]).astype(np.float32)
    return case(square(32), origin, way * [1.0, 1.0, 1.0] * np.where(steep > 0, 1.0, [1.0, 1.0, -1.0]))


def skinny_and_grazing(random: Random, count: int) -> HardCase:
    """Triangles of 11.2, 9.7 and 1.4 as in Embree's report, rays about half a degree off their planes from 600 away."""
    base = np.array([[0.0, 0.0, 0.0], [11.2, 0.0, 0.0], [9.69, 0.44, 0.0]])
    turns = np.linalg.qr(random.standard_normal((200, 3, 3)))[0]
    triangles = base @ turns + 60.0 * random.uniform(-1, 1, (200, 1, 3))
    goal, chosen = points_on(random, triangles, count)
    goal = goal + 0.02 * cube(random, count)
    normal = unit(np.cross(chosen[:, 1] - chosen[:, 0], chosen[:, 2] - chosen[:, 0]))
    flat = unit(chosen[:, 1] - chosen[:, 0]) + cube(random, count) * 0.1
    flat = unit(flat - (flat * normal).sum(axis=1, keepdims=True) * normal)
    origin = (goal - 600.0 * unit(flat + normal * random.uniform(-0.01, 0.01, (count, 1)))).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def bad_case(random: Random, count: int) -> HardCase:
    """pbrt's triangle across x that its test once hit, and the ray within some ulps of it."""
    triangle = np.array(
        [
            [
                [-1113.45459, -79.049614, -56.2431908],
                [-1113.45459, -87.0922699, -56.2431908],
                [-1113.45459, -79.2090149, -56.2431908],
            ]
        ]
    )
    near = 1.0 + random.integers(-4, 5, (count, 6)) * 2.0**-23
    near[0] = 1.0
    origin = np.array([-1081.47925, 99.9999542, 87.7701111]) * near[:, :3]
    return case(triangle, origin, np.array([-32.1072998, -183.355865, -144.607635]) * near[:, 3:], 0.9999)


def beyond(random: Random, count: int, power: float) -> HardCase:
    """A soup of 2^power: products of two, or of three, of its edges leave float32."""
    triangles = soup(random, 200) * 2.0**power
    origin, way = about(random, triangles, count)
    return case(triangles, origin, way)


def _soups() -> tuple[Family, ...]:
    field, unit_scene = (
        "the field's reports on scenes far from the origin",
        "A unit scene {} away has {} of a unit to an ulp.",
    )
    rows = (
        ("far-1e6", 1.0, 1e6, unit_scene.format("1e6", "1/16"), field),
        ("far-1e5", 1.0, 1e5, unit_scene.format("1e5", "1/128"), "mikedh/trimesh issue 48"),
        ("tiny-1e-6", 1e-6, 0.0, "Edges of 1e-6 have determinants of 1e-18, which constants take for 0.", GODOT),
        (
            "huge-1e6",
            1e6,
            0.0,
            "Edges of 1e6 have determinants of 1e18.",
            "GLSL-PathTracer issue 35 (model scaled by 100)",
        ),
    )
    return tuple(
        Family(name, reason, source, partial(placed, scale=scale, offset=offset))
        for name, scale, offset, reason, source in rows
    )


SCALE = (
    *_soups(),
    Family(
        "stadium",
        "A small thing in a large place has boxes and t of very different sizes.",
        "the teapot in a stadium",
        stadium,
    ),
    Family(
        "huge-flat-box",
        "A box of 5.9e11 by 1.2e5 is hit at its lid and not at a t made of rounding.",
        "embree issue 416",
        huge_flat_box,
    ),
    Family(
        "far-eye",
        "An eye 1e7 away sees a unit scene through a handful of float32 directions.",
        "mitsuba2 issue 171 (distant sensor)",
        far_eye,
    ),
    Family("all-sizes", "Sizes from 1e-8 to 1e8 share one tree.", "pbrt-v4 shapes_test.cpp, pExp", all_sizes),
    Family(
        "grazing",
        "A ray a ten-millionth above a surface crosses many cells and hits at a t of few true digits.",
        "grazing shadow rays; mitsuba3 issue 1149",
        grazing,
    ),
    Family(
        "skinny-grazing",
        "Half a degree above a skinny triangle a wrong t is not small.",
        "embree issue 387",
        skinny_and_grazing,
    ),
    Family(
        "pbrt-bad-case",
        "A triangle without area across x must not be hit.",
        "pbrt-v4 shapes_test.cpp, Triangle.BadCases",
        bad_case,
    ),
    Family(
        "products-overflow",
        "At 2^50 the determinant of a triangle is beyond float32.",
        "method.md, Error; renderer/judge/referee/bound.py",
        partial(beyond, power=50.0),
    ),
    Family(
        "squares-overflow",
        "At 2^100 the square of an edge is beyond float32.",
        "Embree verify.cpp (geometry at 1E30)",
        partial(beyond, power=100.0),
    ),
    Family(
        "products-underflow",
        "At 2^-50 the determinant of a triangle is below float32.",
        "method.md, Error; renderer/judge/referee/bound.py",
        partial(beyond, power=-50.0),
    ),
    Family(
        "subnormal",
        "At 2^-130 coordinates themselves are subnormal, which GPUs flush to 0.",
        "Vulkan and ES 3.1 on denormals",
        partial(beyond, power=-130.0),
    ),
)
