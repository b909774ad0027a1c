"""Vectors as tuples of three float64, and a triangle's corners as such."""

from __future__ import annotations

import numpy as np

from renderer.jit import inline
from renderer.records import Floats

Vector = tuple[float, float, float]
Corners = tuple[Vector, Vector, Vector]


@inline
def cross(a: Vector, b: Vector) -> Vector:
    """The cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def dot(a: Vector, b: Vector) -> float:
    """The dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def minus(a: Vector, b: Vector) -> Vector:
    """a - b, each component rounded once."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def magnitudes(a: Vector) -> Vector:
    """The components without their signs."""
    return abs(a[0]), abs(a[1]), abs(a[2])


@inline
def span(a: Vector) -> float:
    """The sum of the components' magnitudes."""
    return abs(a[0]) + abs(a[1]) + abs(a[2])


@inline
def corner(triangles: Floats, i: int, j: int) -> Vector:
    """Corner j of triangle i; float32 is exact in float64."""
    return np.float64(triangles[i, j, 0]), np.float64(triangles[i, j, 1]), np.float64(triangles[i, j, 2])


@inline
def corners(triangles: Floats, i: int) -> Corners:
    """The three corners of triangle i."""
    return corner(triangles, i, 0), corner(triangles, i, 1), corner(triangles, i, 2)
