"""Rays and triangles along the axes: in the faces of boxes, in flat scenes, on split planes."""

from __future__ import annotations

import numpy as np

from scenes.hard_cases.case import Doubles, Family, HardCase, Random, case
from scenes.hard_cases.shapes import cube, cubes, points_on, soup, square, unit


def along(random: Random, count: int, far: float = 9.0) -> Doubles:
    """Directions along the six axes, as (count, 3), the other components 0.0 or -0.0."""
    way = np.copysign(0.0, cube(random, count))
    way[np.arange(count), random.integers(0, 3, count)] = random.choice([-1.0, 1.0], count)
    return way * far / far


def in_faces(random: Random, count: int) -> HardCase:
    """Cubes on whole numbers; rays along the axes from whole and half coordinates, so in faces and edges of boxes."""
    origin = random.integers(-4, 16, (count, 3)) / 2.0
    return case(cubes(3), origin, along(random, count))


def in_corners(random: Random, count: int) -> HardCase:
    """The same cubes, rays in planes of their faces from corner to corner, starting at one or outside."""
    start, end = random.integers(-1, 6, (2, count, 3)).astype(np.float64)
    flat = np.arange(3) == random.integers(0, 3, (count, 1))
    end[flat] = start[flat]
    moved = np.any(start != end, axis=1, keepdims=True)
    return case(cubes(3), start, np.where(moved, end - start, [1.0, 0.0, 0.0]))


def split_planes(random: Random, count: int) -> HardCase:
    """A soup on a grid of 1/8, so that split planes run through vertices; rays from and to the grid's points."""
    triangles = np.round(soup(random, 600, 0.5) * 8.0) / 8.0
    origin, goal = random.integers(-2, 11, (2, count, 3)) / 8.0
    straight = random.random((count, 1)) < 0.5
    way = np.where(straight, along(random, count), goal - origin)
    return case(triangles, origin, np.where(way.any(axis=1, keepdims=True), way, [0.0, 0.0, 1.0]))


def flat_scene(random: Random, count: int) -> HardCase:
    """All in z = 0, where boxes have no volume; rays straight, slanted, grazing, and within the plane."""
    origin = np.concatenate([random.uniform(-1, 9, (count, 2)), random.choice([-3.0, 3.0, 0.0], (count, 1))], axis=1)
    goal = np.concatenate([random.uniform(0, 8, (count, 2)), np.zeros((count, 1))], axis=1)
    straight = (random.random((count, 1)) < 0.3) & (origin[:, 2:] != 0.0)
    way = np.where(straight, np.concatenate([np.zeros((count, 2)), -origin[:, 2:]], axis=1), goal - origin)
    return case(square(8), origin, unit(way))


def flat_in_x_and_y(random: Random, count: int) -> HardCase:
    """Two triangles across x and two across y, whose boxes divide by zero for rays along an axis."""
    flat = square(1)
    triangles = np.concatenate([np.roll(flat, shift, axis=2) for shift in (0, 1, 2)])
    start = np.round(random.uniform(-1, 2, (count, 3)) * 4.0) / 4.0
    return case(triangles, start, along(random, count))


def many_axis_aligned(random: Random, count: int) -> HardCase:
    """12,000 axis-aligned triangles; rays along the axes, inside and outside: what was 700 times slower elsewhere."""
    origin = random.uniform(-2.0, 20.0, (count, 3))
    snapped = random.random((count, 3)) < 0.3
    origin = np.where(snapped, np.round(origin), origin)
    return case(cubes(10), origin, along(random, count))


def in_plane(random: Random, count: int) -> HardCase:
    """Rays within the planes of oblique triangles, from corner through a point of the opposite edge."""
    triangles = soup(random, 300, 1.0).astype(np.float32).astype(np.float64)
    goal, chosen = points_on(random, triangles, count)
    origin = 3.0 * chosen[:, 0] - 2.0 * chosen[:, 1]
    return case(triangles, origin, goal - origin)


AXES = (
    Family(
        "axis-in-faces",
        "A ray along an axis in a box's face is inside the slab for all t, and 0 * inf says neither.",
        "Williams et al. 2005; NVIDIA/warp issue 1530",
        in_faces,
    ),
    Family(
        "planes-of-faces",
        "A ray in the plane of faces, from corner to corner, touches boxes at edges and corners only.",
        "Forceflow/cpu_voxel_raycaster issue 3",
        in_corners,
    ),
    Family(
        "split-planes",
        "Split planes lie exactly on vertices and rays start exactly on split planes: neither side may lose them.",
        "flat KD cells of the field's reports",
        split_planes,
    ),
    Family(
        "flat-scene",
        "A scene without thickness has boxes that are entered and left at one t.",
        "A-Python-Ray-Mesh-Intersector issue 1 (t_max <= t_min lost 2D meshes)",
        flat_scene,
    ),
    Family(
        "flat-boxes",
        "A two-triangle mesh across an axis divides by zero for rays along it.",
        "RayTracing/raytracing.github.io issue 488",
        flat_in_x_and_y,
    ),
    Family(
        "axis-aligned-many",
        "Axis-aligned rays through axis-aligned geometry must not visit everything.",
        "madmann91/bvh issue 21 (700 times slower)",
        many_axis_aligned,
        bar=20.0,
    ),
    Family(
        "in-plane",
        "A ray within a triangle's plane meets it in no one point, and float32 sees that only roughly.",
        "docs/method.md, Error, rule 3",
        in_plane,
    ),
)
