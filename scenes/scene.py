"""What a scene is: triangles, optional vertex normals, one camera, one or more lights."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Point = tuple[float, float, float]

ROW = 3 << 10
"""Coordinates of whole points."""


class SceneError(ValueError):
    """A scene that cannot be used; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Camera:
    """A pinhole: `fov` is the vertical field of view in degrees, points are in scene units."""

    eye: Point
    target: Point
    fov: float
    up: Point = (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """Geometry with one camera and point lights.

    `vertices` is (n, 3) float32, `faces` (m, 3) int32 into it, `normals` (n, 3) float32 of unit length
    or None where shading uses the face's own normal. `lights` are the positions of point lights.
    """

    name: str
    vertices: Floats
    faces: Ints
    normals: Floats | None
    camera: Camera
    lights: tuple[Point, ...]
    source: str = ""
    licence: str = ""
    note: str = ""

    @cached_property
    def triangles(self) -> Floats:
        """The corners of every face, (m, 3, 3) float32."""
        return np.ascontiguousarray(self.vertices[self.faces])

    @cached_property
    def bounds(self) -> Floats:
        """The lower and upper corner of the box around all used vertices, (2, 3) float32."""
        used = np.zeros(len(self.vertices), np.bool_)
        used[self.faces.reshape(-1)] = True
        corners = (self.vertices if used.all() else self.vertices[used]).reshape(-1)
        return np.stack([_each_axis(np.minimum, corners), _each_axis(np.maximum, corners)])

    @property
    def diagonal(self) -> float:
        """The length of the bounds' diagonal in scene units."""
        lower, upper = self.bounds.astype(np.float64)
        return float(np.linalg.norm(upper - lower))

    @cached_property
    def key(self) -> str:
        """A sha256 over the geometry (not the camera or lights), for caches."""
        digest = hashlib.sha256()
        for part in (self.vertices, self.faces, self.normals):
            if part is not None:
                digest.update(str(part.shape).encode())
                digest.update(np.ascontiguousarray(part).data)
        return digest.hexdigest()


def _each_axis(choose: np.ufunc, corners: Floats) -> Floats:
    """`choose` over points one after another, (3,): by long rows, as numpy is many times slower with short ones."""
    whole = len(corners) - len(corners) % ROW
    rest = corners[whole:].reshape(-1, 3)
    if whole:
        rest = np.concatenate([choose.reduce(corners[:whole].reshape(-1, ROW), axis=0).reshape(-1, 3), rest])
    chosen: Floats = choose.reduce(rest, axis=0)
    return chosen
