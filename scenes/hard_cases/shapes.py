"""Triangles that hard cases are made of, (m, 3, 3) float64, and rays at them."""

from __future__ import annotations

import itertools

import numpy as np

from scenes.hard_cases.case import Doubles, Random


def cube(random: Random, count: int) -> Doubles:
    """Points in [-1, 1]^3."""
    return random.uniform(-1.0, 1.0, (count, 3))


def unit(vectors: Doubles) -> Doubles:
    """The vectors at length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def directions(random: Random, count: int) -> Doubles:
    """Uniform directions."""
    return unit(random.standard_normal((count, 3)))


def soup(random: Random, count: int, size: float = 0.3) -> Doubles:
    """Random triangles in and around the unit cube."""
    return np.asarray(random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5))


def patches(grid: Doubles) -> Doubles:
    """Two triangles for every cell of a grid of points (r, c, 3); neighbours share bits."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def sphere_grid(segments: int, radius: Doubles | float = 1.0) -> Doubles:
    """A sphere's points, segments + 1 from pole to pole and 2 segments + 1 around; seam and poles close bit for bit."""
    theta = np.linspace(0.0, np.pi, segments + 1)[:, None]
    phi = np.linspace(0.0, 2.0 * np.pi, 2 * segments + 1)[None, :]
    flat = np.ones_like(phi)
    points = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) * flat, np.sin(theta) * np.sin(phi)], axis=-1)
    points *= np.broadcast_to(radius, points.shape[:2])[..., None]
    points[0], points[-1] = points[0, 0], points[-1, 0]
    points[:, -1] = points[:, 0]
    return points


def without_points(triangles: Doubles) -> Doubles:
    """Those of which no two corners coincide: the poles of a sphere make some that do."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    same = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    return np.asarray(triangles[~same])


def sphere(segments: int, centre: Doubles | float = 0.0, radius: float = 1.0) -> Doubles:
    """A closed sphere of about 4 segments^2 triangles."""
    return without_points(patches(sphere_grid(segments, radius) + centre))


def cubes(side: int) -> Doubles:
    """A lattice of unit cubes on every other whole coordinate."""
    low = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    high = low + np.array([0, 0, 1])
    quads = [np.roll(quad, axis, axis=1) for axis, quad in itertools.product(range(3), (low, high))]
    one = np.concatenate([[quad[[0, 1, 2]], quad[[0, 2, 3]]] for quad in quads])
    corners = 2 * np.stack(np.meshgrid(*[np.arange(side)] * 3), axis=-1).reshape(-1, 1, 1, 3)
    return np.asarray((one[None] + corners).reshape(-1, 3, 3), np.float64)


def square(cells: int, height: float = 0.0) -> Doubles:
    """[0, cells]^2 at z = `height`, in cells of two triangles on whole coordinates."""
    line = np.arange(cells + 1, dtype=np.float64)
    x, y = np.meshgrid(line, line, indexing="ij")
    return patches(np.stack([x, y, np.full_like(x, height)], axis=-1))


def points_on(random: Random, triangles: Doubles, count: int) -> tuple[Doubles, Doubles]:
    """Uniform points on random triangles, and the triangles they lie on, (count, 3, 3)."""
    chosen = triangles[random.integers(0, len(triangles), count)]
    weights = random.dirichlet(np.ones(3), count)
    return np.einsum("nk,nkc->nc", weights, chosen), chosen


def about(random: Random, triangles: Doubles, count: int) -> tuple[Doubles, Doubles]:
    """Ordinary rays: from around the triangles' box to points inside it; origins and unit directions (count, 3)."""
    lower, upper = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    middle, half = (lower + upper) / 2, np.maximum((upper - lower) / 2, 1e-30)
    target = middle + half * cube(random, count)
    origin = middle + 1.5 * np.linalg.norm(half) * directions(random, count)
    return origin, unit(target - origin)
