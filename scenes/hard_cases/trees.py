"""Trees at their limits, and geometry that is no geometry."""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from scenes.hard_cases.case import Family, HardCase, Random, case
from scenes.hard_cases.shapes import about, cube, directions, points_on, soup, sphere, unit


def chain(random: Random, count: int, depth: int, way: Literal["leftward", "rightward"]) -> HardCase:
    """The deepest BVH over depth + 1 triangles: every inner node parts one triangle from the rest."""
    triangles = soup(random, depth + 1, 0.8)
    triangles = triangles[np.argsort(triangles[:, :, 0].mean(axis=1))]
    made = case(triangles, *about(random, triangles, count))
    return HardCase(made.triangles, made.origin, made.direction, made.reach, chain=way)


def progression(random: Random, count: int) -> HardCase:
    """200 triangles, each 0.7 of the one before: SAH parts off a few at a time."""
    one = np.array([[1.0, 0.1, -0.3], [0.7, 0.9, 0.2], [0.6, 0.2, 0.4]])
    triangles = one * (0.7 ** np.arange(200)).reshape(-1, 1, 1)
    size = 0.7 ** random.uniform(0, 200, (count, 1))
    goal, _ = points_on(random, triangles.astype(np.float32).astype(np.float64), count)
    origin = (size * cube(random, count)).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def exponents(random: Random, count: int) -> HardCase:
    """Triangles at distances that double from 2^-60 to 2^60 along each axis: a split parts off one at a time."""
    where = np.zeros((363, 1, 3))
    where[np.arange(363), 0, np.arange(363) // 121] = 2.0 ** (np.arange(363) % 121 - 60.0)
    triangles = where * (1.0 + 0.2 * random.random((363, 3, 3))) + where.max(axis=2, keepdims=True) * 0.1 * cube(
        random, 1089
    ).reshape(363, 3, 3)
    goal, _ = points_on(random, triangles, count)
    origin = (2.0 ** random.uniform(-60, 60, (count, 1)) * cube(random, count)).astype(np.float32)
    return case(triangles, origin, unit(goal - origin))


def garbage(random: Random, count: int, *, finite: bool) -> HardCase:
    """Triangles of random bits, NaN and infinity among them unless `finite`."""
    bits = random.integers(0, 1 << 32, (400, 9), np.uint32)
    if finite:
        bits &= np.where((bits & 0x7F800000) == 0x7F800000, 0xBFFFFFFF, 0xFFFFFFFF).astype(np.uint32)
    triangles = bits.view(np.float32)
    way, size = directions(random, count), 2.0 ** random.uniform(-100, 100, (count, 1))
    made = case(np.zeros((1, 3, 3)), cube(random, count) * size, way)
    return HardCase(triangles.reshape(-1, 3, 3), made.origin, made.direction, made.reach)


def partly_garbage(random: Random, count: int) -> HardCase:
    """A sphere of which 5 in 100 corners have a random exponent."""
    triangles = sphere(16).astype(np.float32).reshape(-1)
    chosen = random.random(len(triangles)) < 0.05
    triangles[chosen] = (triangles[chosen] * 2.0 ** random.uniform(-100, 100, int(chosen.sum()))).astype(np.float32)
    return case(triangles, 0.5 * cube(random, count), directions(random, count))


def one_triangle(random: Random, count: int) -> HardCase:
    """A root that is a leaf."""
    triangle = soup(random, 1, 1.0)
    return case(triangle, *about(random, triangle, count))


def _chains() -> tuple[Family, ...]:
    made: list[Family] = []
    for depth in (32, 33, 64):
        for way in ("leftward", "rightward"):
            make = partial(chain, depth=depth, way=way)
            reason = f"A tree of depth {depth} fills a trail's words and a stack to the end."
            made.append(
                Family(
                    f"chain-{depth}-{way}",
                    reason,
                    "tinybvh pull request 192; three-mesh-bvh pull request 901",
                    make,
                    rays=1024,
                )
            )
    return tuple(made)


TREES = (
    *_chains(),
    Family(
        "progression",
        "Ever smaller triangles make trees far deeper than their number asks for.",
        "gkjohnson/three-mesh-bvh issue 47; tinybvh pull request 164",
        progression,
    ),
    Family(
        "exponents",
        "Sizes that double from 2^-60 to 2^60 make trees deep and slabs overflow.",
        "DGriffin91/obvhs pull request 5",
        exponents,
    ),
    Family(
        "garbage-bits",
        "Corners of random bits, NaN and infinity among them, are refused with a sentence or answered.",
        "Embree verify.cpp, garbage geometry",
        partial(garbage, finite=False),
        rays=1024,
    ),
    Family(
        "garbage-finite",
        "Corners of every finite size make boxes overflow, and walks must end all the same.",
        "Embree verify.cpp, garbage geometry",
        partial(garbage, finite=True),
    ),
    Family(
        "garbage-corners",
        "A mesh with a few absurd corners is still a mesh elsewhere.",
        "Embree verify.cpp, garbage geometry",
        partly_garbage,
    ),
    Family("one-triangle", "A tree whose root is a leaf is walked.", "tests/gpu/hand_made.py", one_triangle, rays=1024),
)
