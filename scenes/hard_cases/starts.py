"""Rays that start on, in and beside surfaces, and rays spawned where others hit."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.hard_cases.case import FARTHEST, Doubles, Family, HardCase, Random, Spawned, case
from scenes.hard_cases.closed import FAR
from scenes.hard_cases.shapes import cube, cubes, directions, points_on, soup, sphere, square, unit


def on_vertices(random: Random, count: int) -> HardCase:
    """Rays that start exactly at corners of triangles: t is 0 there, and no hit."""
    triangles = np.concatenate([soup(random, 200), cubes(2)])
    origin = triangles.reshape(-1, 3)[random.integers(0, 3 * len(triangles), count)]
    return case(triangles, origin, directions(random, count))


def on_surfaces(random: Random, count: int) -> HardCase:
    """Rays that start on faces whose coordinates are exact, in all directions and within the face."""
    triangles = cubes(3)
    origin, _ = points_on(random, triangles, count)
    origin = np.round(origin * 1024.0) / 1024.0
    way = directions(random, count)
    flat = np.isclose(origin, np.round(origin)) & (random.random((count, 1)) < 0.3)
    return case(triangles, origin, unit(np.where(flat, 0.0, way) + np.where(flat.all(axis=1, keepdims=True), way, 0.0)))


def behind(random: Random, count: int) -> HardCase:
    """Rays that start at most 64 ulps before or behind a wall."""
    goal = np.concatenate([random.uniform(0.1, 3.9, (count, 2)), np.ones((count, 1))], axis=1)
    origin = goal * np.concatenate([np.ones((count, 2)), 1.0 + random.integers(-64, 65, (count, 1)) * 2.0**-23], axis=1)
    return case(square(4, 1.0), origin, directions(random, count))


def reintersect(random: Random, count: int) -> HardCase:
    """pbrt's triangles of coordinates 1e-8 to 1e8, a ray at each, and rays that leave the hits on the same side.

    Triangles of less area than pbrt takes are left out; 4 rays leave each hit.
    """
    triangles = _wide(10.0 ** random.uniform(-8, 8, (count, 3, 3)))
    chosen = triangles.astype(np.float32).astype(np.float64)[np.arange(count) % len(triangles)]
    goal = np.einsum("nk,nkc->nc", random.dirichlet(np.ones(3), count), chosen)
    origin = (10.0 ** random.uniform(-8, 8, (count, 3))).astype(np.float32)
    return case(triangles, origin, goal - origin, spawned=_leaving(random, count))


def respawn(random: Random, count: int, triangles: Doubles, centre: Doubles | float, size: float) -> HardCase:
    """Rays from within a closed surface, and rays that leave their hits for the inside again."""
    origin = centre + 0.3 * size * cube(random, count)
    return case(triangles, origin, directions(random, count), spawned=_leaving(random, count))


def grazing_respawn(random: Random, count: int) -> HardCase:
    """Rays that leave a floor of 1e3 at 1e-1 to 1e-5 of a right angle; nothing is above it."""
    floor = (square(16) - [8.0, 8.0, 0.0]) * [60.0, 60.0, 0.0] + [0.0, 0.0, 100.0]
    goal = np.concatenate([400.0 * cube(random, count)[:, :2], np.full((count, 1), 100.0)], axis=1)
    origin = (goal + [0.0, 0.0, 300.0] + 300.0 * cube(random, count) * [1.0, 1.0, 0.5]).astype(np.float32)
    turn, steep = random.uniform(0, 2 * np.pi, count), 10.0 ** random.uniform(-5, -1, count)
    way = np.stack([np.cos(turn), np.sin(turn), steep], axis=1)
    leaving = Spawned(way.astype(np.float32), np.full(count, FARTHEST, np.float32), expect="free")
    return case(floor, origin, unit(goal - origin), spawned=leaving)


def two_sheets(random: Random, count: int, gap: float, size: float) -> HardCase:
    """Two sheets `gap` apart in a scene of `size`; rays from between hit the lower, and the upper hides the light."""
    low, high = square(8) * [1.0, 1.0, 0.0], square(8) * [1.0, 1.0, 0.0] + [0.0, 0.0, gap]
    wide = np.array([[[size, 0, -size], [size, 1, -size], [size, 0, 1 - size]]])
    goal = np.concatenate([random.uniform(2.5, 5.5, (count, 2)), np.zeros((count, 1))], axis=1)
    origin = (
        goal + np.concatenate([0.1 * gap * cube(random, count)[:, :2], np.full((count, 1), gap / 2)], axis=1)
    ).astype(np.float32)
    way = np.concatenate([0.5 * cube(random, count)[:, :2], np.ones((count, 1))], axis=1)
    leaving = Spawned(unit(way).astype(np.float32), np.full(count, FARTHEST, np.float32), expect="blocked")
    return case(np.concatenate([low, high, wide]), origin, goal - origin, spawned=leaving)


def _leaving(random: Random, count: int) -> Spawned:
    return Spawned(directions(random, count).astype(np.float32), np.full(count, FARTHEST, np.float32))


def _wide(triangles: Doubles) -> Doubles:
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(triangles[(normal**2).sum(axis=1) >= 1e-20][:256])


ROUND_FAR = sphere(50, FAR, 2.0)
STARTS = (
    Family(
        "on-vertices", "A ray that starts at a vertex leaves it: t = 0 is no hit.", "pbrt, section 6.8", on_vertices
    ),
    Family(
        "on-surfaces",
        "A ray that starts in a face neither hits it nor loses what is behind.",
        "the field's reports on self-hits",
        on_surfaces,
    ),
    Family(
        "ulps-from-a-wall", "Some ulps before a wall hit it, some behind it do not.", "mikedh/trimesh issue 48", behind
    ),
    Family(
        "reintersect",
        "A ray that leaves a computed hit, at coordinates from 1e-8 to 1e8, does not hit the triangle that it leaves.",
        "pbrt-v4 shapes_test.cpp, Triangle.Reintersect",
        reintersect,
        spawns=True,
    ),
    Family(
        "respawn-far",
        "Hits on a sphere far from the origin are ulps off it, and rays must leave all the same.",
        "demont-engine issue 256; Waechter and Binder 2019",
        partial(respawn, triangles=ROUND_FAR, centre=FAR, size=2.0),
        spawns=True,
    ),
    Family(
        "respawn-tiny",
        "At 1e-5 a constant offset is larger than what it should leave.",
        "RayTracing/raytracing.github.io issue 1298",
        partial(respawn, triangles=sphere(24, 0.0, 1e-5), centre=0.0, size=1e-5),
        spawns=True,
    ),
    Family(
        "respawn-huge",
        "At 1e7 a constant offset is smaller than an ulp of what it should leave.",
        "GLSL-PathTracer issue 35; mitsuba2 issue 171",
        partial(respawn, triangles=sphere(24, 0.0, 1e7), centre=0.0, size=1e7),
        spawns=True,
    ),
    Family(
        "respawn-grazing",
        "A shadow ray that grazes its own floor neither hits it nor anything else.",
        "grazing shadow rays",
        grazing_respawn,
        spawns=True,
    ),
    Family(
        "leak",
        "Light must not pass a sheet because the offset stepped over it.",
        "RayTracing/raytracing.github.io issue 1298",
        partial(two_sheets, gap=1e-3, size=100.0),
        spawns=True,
    ),
)
