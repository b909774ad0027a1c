"""The camera as the shaders take it: the image plane for rays and the matrix for the rasteriser."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenes.scene import Camera, Scene, SceneError

Vector = npt.NDArray[np.float64]

NEAREST = 5e-4
"""The near plane is never nearer than this fraction of the far plane: what a 24-bit depth buffer can bear."""


@dataclass(frozen=True, eq=False)
class View:
    """Where rays start and go: `eye`, unit `forward`; `right` and `up`, half the image plane at distance 1; all (3,).

    `near` and `far` are the rasteriser's planes.
    """

    eye: Vector
    forward: Vector
    right: Vector
    up: Vector
    near: float
    far: float

    @property
    def projection_view(self) -> Vector:
        """World to clip space, (4, 4), row-major, depth -1 to 1 as OpenGL has it."""
        half_width, half_height = np.linalg.norm(self.right), np.linalg.norm(self.up)
        axes = np.stack([self.right / half_width**2, self.up / half_height**2, -self.forward])
        view = np.eye(4)
        view[:3, :3] = axes
        view[:3, 3] = -axes @ self.eye
        near, far = self.near, self.far
        projection = np.zeros((4, 4))
        projection[0, 0] = projection[1, 1] = 1.0
        projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
        projection[3, 2] = -1.0
        return projection @ view


def view_of(scene: Scene, camera: Camera, size: tuple[int, int]) -> View:
    """Place a camera for an image of `size` pixels; raise SceneError for one that looks nowhere."""
    eye, target, up = (np.array(point, np.float64) for point in (camera.eye, camera.target, camera.up))
    finite = bool(np.isfinite([eye, target, up]).all())
    forward = target - eye if finite else np.zeros(3)
    side = np.cross(forward, up) if finite else forward
    if not 0 < camera.fov < 180 or np.linalg.norm(side) == 0:
        raise SceneError("The camera looks nowhere: its eye and target must differ, not along up, with 0 < fov < 180.")
    forward /= np.linalg.norm(forward)
    side /= np.linalg.norm(side)
    half_height = math.tan(math.radians(camera.fov) / 2)
    half_width = half_height * size[0] / size[1]
    near, far = _depth_range(scene, eye, forward)
    return View(eye, forward, side * half_width, np.cross(side, forward) * half_height, near, far)


def _depth_range(scene: Scene, eye: Vector, forward: Vector) -> tuple[float, float]:
    lower, upper = scene.bounds.astype(np.float64)
    corners = np.stack(np.meshgrid(*np.stack([lower, upper], axis=1)), axis=-1).reshape(-1, 3)
    depth = (corners - eye) @ forward
    far = max(float(depth.max()) * 1.01, scene.diagonal * 1e-3, 1e-30)
    return max(float(depth.min()) * 0.99, far * NEAREST), far
