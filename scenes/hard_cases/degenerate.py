"""Triangles that hardly are any, and ones that lie on each other."""

from __future__ import annotations

import numpy as np

from scenes.hard_cases.case import Family, HardCase, Random, case
from scenes.hard_cases.shapes import about, cube, directions, points_on, soup, square, unit


def slivers(random: Random, count: int) -> HardCase:
    """Triangles 1e-2 to 1e-7 as wide as long, rays at points of them."""
    width = 10.0 ** random.uniform(-7, -2, (400, 1))
    start, along, across = random.random((400, 3)), directions(random, 400), directions(random, 400)
    triangles = np.stack([start, start + along, start + along / 3 + width * across], axis=1)
    goal, _ = points_on(random, triangles.astype(np.float32).astype(np.float64), count)
    origin = (goal + 3.0 * directions(random, count)).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def degenerates(random: Random, count: int) -> HardCase:
    """Points, lines and triangles folded back onto themselves among 200 whole ones; rays at all of them."""
    mixed = soup(random, 800).astype(np.float32).astype(np.float64)
    mixed[::4] = mixed[::4, :1]
    mixed[1::8, 2] = mixed[1::8, 1]
    mixed[5::8, 2] = (mixed[5::8, 0] + mixed[5::8, 1]) / 2
    mixed = random.permutation(mixed)
    goal, _ = points_on(random, mixed, count)
    origin = (goal + 2.0 * directions(random, count)).astype(np.float32)
    return case(mixed, origin, goal - origin)


def only_degenerates(random: Random, count: int) -> HardCase:
    """Nothing but points and lines, which nothing hits."""
    flat = soup(random, 300)
    flat[::2] = flat[::2, :1]
    flat[1::2, 2] = flat[1::2, 0]
    return case(flat, *about(random, flat, count))


def duplicates(random: Random, count: int) -> HardCase:
    """One large triangle 300 times, more than a leaf holds: the smallest number is the hit."""
    triangles = np.repeat([[[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 18.0, 0.0]]], 300, axis=0)
    origin = np.array([0.0, 0.0, 5.0]) + 2.0 * cube(random, count)
    goal = np.concatenate([3.0 * cube(random, count)[:, :2], np.zeros((count, 1))], axis=1)
    return case(triangles, origin, unit(goal - origin))


def overlaps(random: Random, count: int) -> HardCase:
    """400 triangles of different shapes in one oblique plane, which rays meet at one t."""
    frame = unit(np.array([[2.0, 1.0, 0.5], [-1.0, 2.0, 0.25]]))
    triangles = (random.integers(-64, 65, (400, 3, 2)) / 16.0) @ frame
    goal, _ = points_on(random, triangles, count)
    origin = goal + 4.0 * directions(random, count)
    return case(triangles, origin, unit(goal - origin))


def sheets(random: Random, count: int) -> HardCase:
    """64 squares a few ulps apart: which one is first is a matter of the last bits of t."""
    heights = np.float32(1.0) + np.arange(64) * 2.0**-23
    triangles = np.concatenate([square(1, float(height)) for height in random.permutation(heights)])
    origin = np.concatenate([random.random((count, 2)), random.choice([-4.0, 6.0], (count, 1))], axis=1)
    goal = np.concatenate([random.random((count, 2)), np.ones((count, 1))], axis=1)
    return case(triangles, origin, unit(goal - origin))


def nested(random: Random, count: int) -> HardCase:
    """Triangles of one centre, each half as large again: boxes within boxes, whose centres split nothing."""
    one = np.array([[1.0, 0.0, 0.2], [-0.6, 0.8, -0.1], [-0.4, -0.8, -0.1]])
    triangles = one * (1.5 ** np.arange(60)).reshape(-1, 1, 1)
    size = 1.5 ** random.uniform(0, 60, (count, 1))
    return case(triangles, size * cube(random, count), directions(random, count))


DEGENERATE = (
    Family(
        "slivers",
        "Needles a ten-millionth as wide as long leave float32 no room between their edges.",
        "embree issue 387 (skinny triangle, far false hit)",
        slivers,
    ),
    Family(
        "degenerate-triangles",
        "Points and lines have no normal, must never be hit and must not hide what is whole.",
        "Embree verify.cpp, overlapping and garbage geometry",
        degenerates,
    ),
    Family(
        "only-degenerates",
        "A scene of points and lines is empty, and a tree over it is still walked.",
        "Embree verify.cpp, empty geometry",
        only_degenerates,
    ),
    Family(
        "duplicates",
        "No split parts equal triangles, leaves overflow, and ties go to the smallest number.",
        "pbrt-v3 issue 182; hoverinc/ray-tracing-renderer pull request 81",
        duplicates,
    ),
    Family(
        "coplanar-overlaps",
        "Different triangles of one plane are met at one t by real numbers and at several by float32.",
        "Embree verify.cpp, overlapping_primitives",
        overlaps,
    ),
    Family("ulp-sheets", "Sheets one ulp apart are told apart by the last bits of t.", "pbrt, section 6.8", sheets),
    Family(
        "nested",
        "Boxes inside boxes of one centre give split planes and orders nothing to go by.",
        "gkjohnson/three-mesh-bvh issue 283; pbrt-v3 issue 182",
        nested,
    ),
)
