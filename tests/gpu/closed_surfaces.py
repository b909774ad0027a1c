"""Surfaces without holes and the rays that must hit them: Embree's watertight set and pbrt's vertex test."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.records import Rays
from scenes.scene import Camera, Scene

Doubles = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

FAR = np.array([148376.0, 1234.0, -223423.0])
"""Where Embree's verify puts its watertight set."""


def sphere(name: str, segments: int, centre: Doubles, radius: float, *, jitter: float = 0.0, seed: int = 0) -> Scene:
    """A closed sphere of 4 segments (segments - 1) triangles; `jitter` moves vertices by up to that part of it."""
    phi = np.linspace(0.0, np.pi, segments + 1)[1:-1]
    theta = np.linspace(0.0, 2.0 * np.pi, 2 * segments, endpoint=False)
    p, t = np.meshgrid(phi, theta, indexing="ij")
    rings = np.stack([np.sin(p) * np.sin(t), np.cos(p), np.sin(p) * np.cos(t)], axis=-1).reshape(-1, 3)
    unit = np.concatenate([rings, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    unit += jitter * np.random.default_rng(seed).uniform(-1.0, 1.0, unit.shape)
    at = np.arange(len(rings)).reshape(p.shape)
    after = np.roll(at, -1, axis=1)
    north, south = np.full(len(theta), len(rings)), np.full(len(theta), len(rings) + 1)
    caps = np.concatenate([np.stack([north, at[0], after[0]], 1), np.stack([south, after[-1], at[-1]], 1)])
    return _scene(name, centre + radius * unit, np.concatenate([_halves(at, after), caps]))


def plane(name: str, segments: int, corner: Doubles, side: float) -> Scene:
    """A square of 2 segments^2 triangles across x from `corner` on, `side` long in y and z."""
    steps = side * np.linspace(0.0, 1.0, segments + 1)
    y, z = np.meshgrid(steps, steps, indexing="ij")
    at = np.arange(y.size).reshape(y.shape)
    return _scene(name, corner + np.stack([0 * y, y, z], axis=-1).reshape(-1, 3), _halves(at[:, :-1], at[:, 1:]))


def rays_within(centre: Doubles, spread: float, count: int, seed: int) -> Rays:
    """Rays of random directions from a cube of half the side `spread` around `centre`."""
    rng = np.random.default_rng(seed)
    return _rays(centre + spread * rng.uniform(-1.0, 1.0, (count, 3)), rng.standard_normal((count, 3)))


def rays_to(points: Doubles, centre: Doubles, spread: float, seed: int) -> Rays:
    """A ray to each of `points` (n, 3) from a random point around `centre`."""
    origin = (centre + spread * np.random.default_rng(seed).uniform(-1.0, 1.0, points.shape)).astype(np.float32)
    return _rays(origin, points - origin)


def shared_edges(scene: Scene, count: int, seed: int) -> Doubles:
    """Points on random edges of the scene, (count, 3)."""
    rng = np.random.default_rng(seed)
    face, side = rng.integers(len(scene.faces), size=count), rng.integers(3, size=count)
    corners = scene.triangles.astype(np.float64)
    a, b = corners[face, side], corners[face, (side + 1) % 3]
    return np.asarray(a + rng.random((count, 1)) * (b - a))


def _halves(at: Indices, after: Indices) -> Indices:
    """Two triangles for each quad between a grid's rows; `after` is `at` one column on."""
    quads = np.stack([at[:-1], at[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _rays(origin: npt.NDArray[np.floating], direction: Doubles) -> Rays:
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    reach = np.full(len(origin), np.finfo(np.float32).max, np.float32)
    return Rays(origin.astype(np.float32), unit.astype(np.float32), reach)


def _scene(name: str, vertices: Doubles, faces: Indices) -> Scene:
    eye, target = (tuple(vertices[i].tolist()) for i in (0, -1))
    camera = Camera((eye[0], eye[1], eye[2]), (target[0], target[1], target[2]), 40.0)
    return Scene(name, vertices.astype(np.float32), faces.astype(np.int32), None, camera, (camera.eye,))
