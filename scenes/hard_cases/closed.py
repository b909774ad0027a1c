"""Surfaces without holes, seen by rays that cannot leave them."""

from __future__ import annotations

from functools import partial

import numpy as np

from scenes.hard_cases.case import Doubles, Family, HardCase, Random, case
from scenes.hard_cases.shapes import cube, directions, patches, sphere, sphere_grid, square, unit, without_points

FAR = np.array([148376.0, 1234.0, -223423.0])
"""Where Embree's watertight test puts its surfaces."""

EMBREE = "Embree tutorials/verify/verify.cpp, WatertightTest (bar: 2e-5 misses)"
PBRT = "pbrt-v4 src/pbrt/shapes_test.cpp, Triangle.Watertight (disabled upstream)"


def far_sphere(random: Random, count: int, segments: int) -> HardCase:
    """Radius 2 at FAR, rays from within [-1, 1]^3 around its centre. Its corners are rounded once, so it is closed."""
    return case(sphere(segments, FAR, 2.0), FAR + cube(random, count), cube(random, count), closed=True)


def far_plane(random: Random, count: int, segments: int) -> HardCase:
    """12 x 12 across x at FAR, rays from 3 before it that cannot pass its rim."""
    line = np.linspace(-6.0, 6.0, segments + 1)
    y, z = np.meshgrid(line, line, indexing="ij")
    wall = patches(np.stack([np.zeros_like(y), y, z], axis=-1) + FAR)
    way = np.concatenate([np.ones((count, 1)), random.uniform(-1.0, 1.0, (count, 2))], axis=1)
    return case(wall, FAR - [3.0, 0.0, 0.0], way, closed=True)


def rough_grid(random: Random, segments: int = 15) -> Doubles:
    """pbrt's sphere of 16 x 16 points, each moved out along its normal by up to 5 radii."""
    radius = 1.0 + 5.0 * random.random((segments + 1, 2 * segments + 1))
    radius[0], radius[-1] = 1.0, 1.0
    return np.asarray(sphere_grid(segments, radius).astype(np.float32), np.float64)


def rough_sphere(random: Random, count: int, aim: str) -> HardCase:
    """pbrt's sphere, rays from within a ball of half its radius, in all directions, at vertices or at edges."""
    grid = rough_grid(random)
    triangles = without_points(patches(grid))
    origin = np.asarray((0.5 * directions(random, count)).astype(np.float32), np.float64)
    if aim == "anywhere":
        return case(triangles, origin, directions(random, count), closed=True)
    corners = triangles[random.integers(0, len(triangles), count)]
    between = random.random((count, 1)) if aim == "edges" else np.zeros((count, 1))
    goal = corners[:, 0] + between * (corners[:, 1] - corners[:, 0])
    return case(triangles, origin, goal - origin, closed=True)


def shared_diagonal(random: Random, count: int) -> HardCase:
    """A square of two triangles, rays to points of the diagonal that they share."""
    triangles = np.array([[[-5, -5, 0], [5, -5, 0], [5, 5, 0]], [[-5, -5, 0], [5, 5, 0], [-5, 5, 0]]], np.float64)
    along = random.uniform(-4.9, 4.9, (count, 1))
    goal = np.concatenate([along, along, np.zeros((count, 1))], axis=1)
    origin = np.array([0.0, 0.0, 10.0]) + np.where(random.random((count, 1)) < 0.5, cube(random, count), 0.0)
    return case(triangles, origin, unit(goal - origin), closed=True)


def grid_vertices(random: Random, count: int) -> HardCase:
    """A flat grid on whole coordinates; rays along z and from one eye exactly to its inner vertices."""
    goal = np.concatenate([random.integers(1, 32, (count, 2)), np.zeros((count, 1))], axis=1).astype(np.float64)
    straight = random.random((count, 1)) < 0.5
    above = np.array([0.0, 0.0, 8.0])
    origin = np.where(straight, goal + above, [16.0, 16.0, 8.0])
    return case(square(32), origin, goal - origin, closed=True)


def whole_terrain(random: Random, count: int) -> HardCase:
    """Hills of whole heights on whole coordinates, rays down to their vertices, edge middles and diagonals."""
    line = np.arange(49, dtype=np.float64)
    x, y = np.meshgrid(line, line, indexing="ij")
    grid = np.stack([x, y, random.integers(0, 9, x.shape).astype(np.float64)], axis=-1)
    halves = random.integers(4, 92, (count, 2)) / 2.0
    origin = np.concatenate([halves, np.full((count, 1), 20.0)], axis=1)
    lean = np.where(random.random((count, 1)) < 0.5, random.integers(-1, 2, (count, 2)) / 64.0, 0.0)
    return case(patches(grid), origin, np.concatenate([lean, -np.ones((count, 1))], axis=1), closed=True)


def fan(random: Random, count: int) -> HardCase:
    """200 needles that meet in one vertex, rays to it and close around it."""
    turn = np.linspace(0.0, 2.0 * np.pi, 201)
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=-1)
    rim[-1] = rim[0]
    triangles = np.stack([np.broadcast_to([0.0, 0.0, 0.0], (200, 3)), rim[:-1], rim[1:]], axis=1)
    goal = np.zeros((count, 3))
    goal[:, :2] = random.standard_normal((count, 2)) * 10.0 ** random.uniform(-9, -2, (count, 1))
    goal[::2] = 0.0
    origin = np.array([0.1, 0.2, 2.0]) + 0.5 * cube(random, count)
    return case(triangles, origin, goal - origin.astype(np.float32), closed=True)


CLOSED = (
    *(
        Family(
            f"embree-sphere-{n}",
            "A sphere far from the origin has no hole, however its corners are rounded.",
            EMBREE,
            partial(far_sphere, segments=n),
            rays=16384,
        )
        for n in (50, 200)
    ),
    *(
        Family(
            f"embree-plane-{n}",
            "A wall far from the origin lets no ray through the edges that its triangles share.",
            EMBREE,
            partial(far_plane, segments=n),
            rays=16384,
        )
        for n in (50, 200)
    ),
    Family(
        "pbrt-sphere",
        "A rough closed surface stops every ray from inside.",
        PBRT,
        partial(rough_sphere, aim="anywhere"),
        rays=8192,
    ),
    Family(
        "pbrt-vertices",
        "A ray aimed at a vertex hits one of the triangles around it.",
        PBRT,
        partial(rough_sphere, aim="vertices"),
        rays=8192,
    ),
    Family(
        "pbrt-edges",
        "A ray aimed at an edge hits one of its two triangles.",
        PBRT,
        partial(rough_sphere, aim="edges"),
        rays=8192,
    ),
    Family(
        "shared-diagonal",
        "Rays to the diagonal of a flat square round to either side of it, and must not fall between.",
        "Oblikovati issue 2146; Woop, Benthin and Wald 2013",
        shared_diagonal,
        rays=8192,
    ),
    Family(
        "grid-vertices",
        "Rays to the vertices of a grid on whole coordinates compute edges that are exactly 0.",
        "trimesh issue 1496; the integer-grid dragon of the field's reports",
        grid_vertices,
        rays=8192,
    ),
    Family(
        "whole-terrain",
        "Whole and half coordinates put rays on vertices, edges, box faces and split planes all at once.",
        "the integer-grid dragon of the field's reports",
        whole_terrain,
        rays=8192,
    ),
    Family(
        "needle-fan",
        "Where 200 needles meet every test is close to an edge.",
        "mitsuba3 issue 1149 (rays lost at the edges of sphere pieces)",
        fan,
        rays=4096,
    ),
)
