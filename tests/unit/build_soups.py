"""Triangle bounds that are hard on builders, each by name; seeds are in the names."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]


def soup(number: int, seed: int, size: float = 0.05) -> Floats:
    """Random boxes in the unit cube, (number, 2, 3)."""
    rng = np.random.default_rng(seed)
    corners = rng.random((number, 1, 3)) + size * rng.random((number, 3, 3))
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1).astype(np.float32)


def lattice(number: int, seed: int) -> Floats:
    """Boxes with whole-number corners: shared planes, flat boxes, lines, points and both zeros."""
    rng = np.random.default_rng(seed)
    corners = rng.integers(-4, 5, (number, 3, 3)).astype(np.float32) * rng.choice([-1, 1], (number, 3, 1))
    flat = rng.random(number) < 0.4
    corners[flat, :, 1] = corners[flat, :1, 1]
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1).astype(np.float32)


def flat_grid(side: int) -> Floats:
    """Two triangles' boxes a cell of a grid in the plane z = 0."""
    cells = np.stack(np.meshgrid(np.arange(side), np.arange(side), [0]), axis=-1).reshape(-1, 3)
    boxes = np.stack([cells, cells + np.array([1, 1, 0])], axis=1).astype(np.float32)
    return np.repeat(boxes, 2, axis=0)


def points(number: int, seed: int) -> Floats:
    """Boxes without extent."""
    corner = np.random.default_rng(seed).random((number, 1, 3)).astype(np.float32)
    return np.repeat(corner, 2, axis=1)


def line(number: int, seed: int) -> Floats:
    """Boxes with extent along x only."""
    boxes = soup(number, seed)
    boxes[:, :, 1:] = 0.5
    return boxes


def shrinking(copies: int) -> Floats:
    """Boxes that halve towards the origin, over all of float32's scales, with copies: deep, uneven trees."""
    corner = np.ldexp(1.0, -np.arange(120))
    boxes = np.stack([corner, 2 * corner], axis=1)[:, :, np.newaxis] * np.ones(3)
    return np.repeat(boxes.astype(np.float32), copies, axis=0)


SOUPS: dict[str, Callable[[], Floats]] = {
    "one": lambda: soup(1, 1),
    "two": lambda: soup(2, 2),
    "five-seed3": lambda: soup(5, 3),
    "soup-3000-seed4": lambda: soup(3000, 4),
    "large-triangles-seed5": lambda: soup(400, 5, size=1.0),
    "lattice-500-seed6": lambda: lattice(500, 6),
    "lattice-40-seed7": lambda: lattice(40, 7),
    "flat-grid": lambda: flat_grid(20),
    "points-seed8": lambda: points(700, 8),
    "one-point": lambda: np.full((700, 2, 3), 0.25, np.float32),
    "origin": lambda: np.zeros((3, 2, 3), np.float32),
    "line-seed9": lambda: line(700, 9),
    "duplicates": lambda: np.repeat(soup(1, 10), 2000, axis=0),
    "coplanar-duplicates-seed11": lambda: np.repeat(flat_grid(2), 300, axis=0),
    "shrinking": lambda: shrinking(1),
    "shrinking-copies": lambda: shrinking(40),
    "tiny-seed12": lambda: soup(300, 12) * np.float32(1e-30),
    "huge-seed13": lambda: soup(300, 13) * np.float32(1e37),
}
