"""A camera and a light for geometry that came without them."""

from __future__ import annotations

import math

import numpy as np

from scenes.scene import Camera, Floats, Ints, Point

FOV = 40.0
MARGIN = 1.05
EYE_DIRECTION = (0.6, 0.45, 1.0)
LIGHT_DIRECTION = (-0.5, 1.0, 0.7)


def automatic_camera(vertices: Floats, faces: Ints) -> Camera:
    """A three-quarter view that holds the whole bounding sphere of the used vertices, up y."""
    centre, radius = _sphere(vertices, faces)
    distance = MARGIN * radius / math.sin(math.radians(FOV / 2))
    return Camera(_along(centre, EYE_DIRECTION, distance), _point(centre), FOV)


def automatic_light(vertices: Floats, faces: Ints) -> Point:
    """A point above and beside the object, three radii from its centre."""
    centre, radius = _sphere(vertices, faces)
    return _along(centre, LIGHT_DIRECTION, 3.0 * radius)


def _sphere(vertices: Floats, faces: Ints) -> tuple[np.ndarray, float]:
    used = vertices[np.unique(faces)].astype(np.float64)
    lower, upper = used.min(axis=0), used.max(axis=0)
    radius = float(np.linalg.norm(upper - lower)) / 2
    return (lower + upper) / 2, radius or 1.0


def _along(centre: np.ndarray, direction: Point, distance: float) -> Point:
    unit = np.array(direction) / np.linalg.norm(direction)
    return _point(centre + unit * distance)


def _point(values: np.ndarray) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
