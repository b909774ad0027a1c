"""Scenes that need no download: a forest and a statue, from a seed and a triangle count.

Coordinates are rounded to 2^-16 units, so that last-bit differences between builds of the maths library leave
the geometry, and with it every cached structure, the same.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenes.mesh import Mesh
from scenes.scene import SceneError

Array = npt.NDArray[np.float64]
GRID = 65536.0
UP = np.array([0.0, 1.0, 0.0])
FOREST_TRIANGLES = 174_000
FOREST_MIN, FOREST_MAX = 4_000, 4_000_000
FOREST_HALF_SIDE = 12.0
# No tree stands closer to the catalogue camera than this, in units of about a metre.
CLEARING = 1.6
FOREST_EYE = (0.4, 1.5, 6.5)
STATUE_MIN, STATUE_MAX = 400, 1_000_000


def forest(triangles: int = FOREST_TRIANGLES, seed: int = 1) -> Mesh:
    """A wood of exactly `triangles` triangles: the procedural stand-in for Fairy Forest.

    Like that scene it has small detail inside a large space and rays that pass many thin triangles: a hilly
    ground, trees with branches, loose leaves and grass. One unit is about a metre, the ground is 24 wide.
    SceneError where the count is out of range.
    """
    _check(triangles, FOREST_MIN, FOREST_MAX, "forest")
    rng = np.random.default_rng(seed)
    side = max(int(math.sqrt(0.06 * triangles)), 8)
    trees = min(max(triangles // 2000, 8), 72)
    roots = _tree_places(rng, trees)
    heights = 3.5 + 3.0 * rng.random(trees)
    wood = np.concatenate([_ground(side), *_trunks(roots, heights), *_branches(rng, roots, heights)])
    loose = triangles - len(wood)
    grass = _grass(rng, int(0.35 * loose))
    leaves = _leaves(rng, roots, heights, loose - len(grass))
    return _soup(np.concatenate([wood, grass, leaves]))


def statue(triangles: int, seed: int = 1) -> Mesh:
    """A closed, detailed surface of about `triangles` triangles standing on the floor of the Cornell box.

    A tube around a (2, 3) torus knot with displaced surface; watertight since both parameters wrap around.
    Within 1 % of the count. SceneError where the count is out of range.
    """
    _check(triangles, STATUE_MIN, STATUE_MAX, "cornell-statue")
    along, around = _grid_shape(triangles)
    t = np.linspace(0.0, 2 * np.pi, along, endpoint=False)[:, None]
    u = np.linspace(0.0, 2 * np.pi, around, endpoint=False)[None, :]
    centre, normal, binormal = _knot(t)
    radius = 0.1 * (1.0 + _relief(t, u, seed))[..., None]
    points = centre + radius * (np.cos(u)[..., None] * normal + np.sin(u)[..., None] * binormal)
    points = points.reshape(-1, 3)
    # The feet stand just above the floor: touching it would make coplanar pieces.
    points += np.array([0.0, 0.02 - points[:, 1].min(), -0.05])
    return Mesh(_rounded(points), _torus_faces(along, around))


def _check(triangles: int, lowest: int, highest: int, name: str) -> None:
    if not lowest <= triangles <= highest:
        raise SceneError(
            f"{name} cannot have {triangles:,} triangles: ask for {lowest:,} to {highest:,}, as in {name}:{highest}."
        )


def _rounded(points: Array) -> npt.NDArray[np.float32]:
    return (np.round(points * GRID) / GRID).astype(np.float32)


def _soup(corners: Array) -> Mesh:
    """Unshared corners (m, 3, 3) as a mesh."""
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return Mesh(_rounded(corners.reshape(-1, 3)), faces)


def _height(x: Array, z: Array) -> Array:
    """The forest's ground: smooth hills, falling slightly towards the camera's side."""
    hills = 0.35 * np.sin(0.55 * x + 0.4) * np.cos(0.45 * z) + 0.12 * np.sin(1.7 * x + 0.9 * z)
    return hills + 0.03 * np.sin(5.1 * x) * np.sin(4.3 * z) - 0.02 * z


def _ground(side: int) -> Array:
    line = np.linspace(-FOREST_HALF_SIDE, FOREST_HALF_SIDE, side + 1)
    x, z = np.meshgrid(line, line, indexing="ij")
    return _patches(np.stack([x, _height(x, z), z], axis=-1))


def _patches(grid: Array) -> Array:
    """Two triangles for every cell of a grid of points (r, c, 3)."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _tree_places(rng: np.random.Generator, count: int) -> Array:
    """Jittered grid cells in random order; a tree in the clearing moves out to its rim."""
    side = math.ceil(math.sqrt(count))
    cells = rng.permutation(side * side)[:count]
    place = np.stack([cells // side, cells % side], axis=1) + 0.15 + 0.7 * rng.random((count, 2))
    place = (2 * place / side - 1) * 0.95 * FOREST_HALF_SIDE
    eye = np.array([FOREST_EYE[0], FOREST_EYE[2]])
    away = place - eye
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    place = np.where(distance < CLEARING, eye + away / distance * CLEARING, place)
    return np.stack([place[:, 0], _height(place[:, 0], place[:, 1]), place[:, 1]], axis=1)


def _tube(start: Array, end: Array, thick: float, thin: float, bend: float, rings: int, sides: int) -> Array:
    """A tapered tube from `start` to `end`, bent sideways by `bend` units in its middle."""
    s = np.linspace(0.0, 1.0, rings + 1)[:, None, None]
    turn = np.linspace(0.0, 2 * np.pi, sides + 1)[None, :, None]
    axis = (end - start) / np.linalg.norm(end - start)
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across)
    circle = np.cos(turn) * across + np.sin(turn) * np.cross(axis, across)
    spine = start + s * (end - start) + bend * np.sin(np.pi * s) * across
    return _patches(spine + (thick + (thin - thick) * s) * circle)


def _trunks(roots: Array, heights: Array) -> list[Array]:
    return [
        _tube(root - 0.1 * UP, root + h * UP, 0.05 * h, 0.01 * h, 0.03 * h, rings=8, sides=9)
        for root, h in zip(roots, heights, strict=True)
    ]


def _branches(rng: np.random.Generator, roots: Array, heights: Array, each: int = 5) -> list[Array]:
    tubes = []
    for root, h in zip(roots, heights, strict=True):
        for level, angle in zip(np.linspace(0.4, 0.85, each), 2 * np.pi * rng.random(each), strict=True):
            start = root + np.array([0.0, level * h, 0.0])
            reach = 0.3 * h * (1.2 - level)
            end = start + reach * np.array([math.cos(angle), 0.5, math.sin(angle)])
            tubes.append(_tube(start, end, 0.012 * h, 0.003 * h, 0.02 * h, rings=3, sides=5))
    return tubes


def _grass(rng: np.random.Generator, count: int) -> Array:
    """Single triangles standing on the ground, denser towards the camera's side."""
    x = FOREST_HALF_SIDE * (2 * rng.random(count) - 1)
    z = FOREST_HALF_SIDE * (1 - 2 * rng.random(count) ** 1.5)
    base = np.stack([x, _height(x, z) - 0.01, z], axis=1)
    turn = 2 * np.pi * rng.random(count)
    flat = np.stack([np.cos(turn), np.zeros(count), np.sin(turn)], axis=1)
    lean = np.stack([-0.3 * np.sin(turn), np.ones(count), 0.3 * np.cos(turn)], axis=1)
    tall = (0.08 + 0.22 * rng.random(count))[:, None]
    return np.stack([base - 0.012 * flat, base + 0.012 * flat, base + tall * lean], axis=1)


def _leaves(rng: np.random.Generator, roots: Array, heights: Array, count: int) -> Array:
    """Loose triangles of random orientation in ellipsoidal crowns, thinner in the middle than at the rim."""
    tree = np.arange(count) % len(roots)
    h = heights[tree][:, None]
    direction = _directions(rng, count)
    rim = (0.35 + 0.65 * rng.random(count) ** 0.5)[:, None]
    crown = roots[tree] + 0.72 * h * UP
    centre = crown + rim * direction * np.array([0.3, 0.34, 0.3]) * h
    first, helper = _directions(rng, count), _directions(rng, count)
    second = np.cross(first, helper)
    # Nearly parallel directions would make slivers; they keep the cross product's shorter side.
    second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), 0.2)
    size = (0.04 + 0.05 * rng.random(count))[:, None]
    return np.stack([centre - size * first, centre + size * first, centre + 1.6 * size * second], axis=1)


def _directions(rng: np.random.Generator, count: int) -> Array:
    """Uniform unit vectors (Archimedes: the height of a point on the sphere is uniform)."""
    y = 2 * rng.random(count) - 1
    turn = 2 * np.pi * rng.random(count)
    flat = np.sqrt(1 - y * y)
    return np.stack([flat * np.cos(turn), y, flat * np.sin(turn)], axis=1)


def _grid_shape(triangles: int) -> tuple[int, int]:
    """Rows and columns of a wrapped grid with 2 * rows * columns nearest to `triangles`, cells about square."""
    quads = triangles / 2
    ideal = math.sqrt(quads / 9.0)
    candidates = range(max(3, math.floor(0.8 * ideal)), math.ceil(1.25 * ideal) + 2)
    around = min(candidates, key=lambda n: (abs(round(quads / n) * n - quads), abs(n - ideal)))
    return round(quads / around), around


def _knot(t: Array) -> tuple[Array, Array, Array]:
    """The (2, 3) torus knot upright in the box, with a normal and binormal that close up; each (n, 1, 3)."""
    major, minor = 0.4, 0.21
    ring = np.concatenate([np.cos(2 * t), np.sin(2 * t), np.zeros_like(t)], axis=1)
    ring_step = np.concatenate([-2 * np.sin(2 * t), 2 * np.cos(2 * t), np.zeros_like(t)], axis=1)
    depth = np.array([0.0, 0.0, 1.0])
    reach = major + minor * np.cos(3 * t)
    centre = reach * ring + minor * np.sin(3 * t) * depth
    tangent = reach * ring_step - 3 * minor * np.sin(3 * t) * ring + 3 * minor * np.cos(3 * t) * depth
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The torus' own normal is orthogonal to every curve on it.
    normal = np.cos(3 * t) * ring + np.sin(3 * t) * depth
    return centre[:, None], normal[:, None], np.cross(tangent, normal)[:, None]


def _relief(t: Array, u: Array, seed: int) -> Array:
    """Relative displacement: waves of whole periods, so the surface closes; amplitudes fall with frequency."""
    rng = np.random.default_rng(seed)
    total = np.zeros(np.broadcast_shapes(t.shape, u.shape))
    for octave in range(5):
        for _ in range(3):
            m, n = int(rng.integers(12, 25)) << octave, int(rng.integers(1, 4)) << octave
            total += 0.06 / 1.7**octave * np.sin(m * t + n * u + 2 * np.pi * rng.random())
    return total


def _torus_faces(along: int, around: int) -> npt.NDArray[np.int32]:
    index = np.arange(along * around, dtype=np.int32).reshape(along, around)
    down, right = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    both = np.roll(down, -1, axis=1)
    pairs = np.stack([index, both, down, index, right, both], axis=-1)
    return np.ascontiguousarray(pairs.reshape(-1, 3))
