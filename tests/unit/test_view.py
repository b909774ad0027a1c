"""The camera: rays and the rasteriser's matrix agree on which pixel a point is in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from renderer.view import View, view_of
from scenes.load import load
from scenes.scene import Camera, SceneError

Vectors = npt.NDArray[np.float64]

BOX = load("cornell-box")
CAMERAS = {
    "catalogue": BOX.camera,
    "tilted": Camera((2.0, 3.0, 1.5), (-0.5, 0.4, -0.2), 75.0, (0.3, 1.0, -0.2)),
    "narrow": Camera((0.0, 1.0, 40.0), (0.1, 1.0, 0.0), 2.0),
    "from inside": Camera((0.0, 1.0, 0.0), (0.2, 0.9, -1.0), 100.0),
}
SIZES = ((64, 64), (100, 37), (1, 1), (37, 100))


def pixel_centres(width: int, height: int) -> Vectors:
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return np.asarray(np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5, np.float64)


def ray_directions(view: View, centres: Vectors, size: tuple[int, int]) -> Vectors:
    """As `shaders/common_view.glsl` has it, in float64."""
    plane = centres * 2.0 / np.array(size) - 1.0
    return np.asarray(view.forward + plane[:, :1] * view.right + plane[:, 1:] * view.up)


def projected(matrix: Vectors, points: Vectors) -> Vectors:
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return np.asarray(clip[:, :3] / clip[:, 3:])


def look_at(camera: Camera, aspect: float, near: float, far: float) -> Vectors:
    """The matrix of gluPerspective and gluLookAt, by their manual pages."""
    f = 1.0 / math.tan(math.radians(camera.fov) / 2)
    perspective = np.array(
        [
            [f / aspect, 0, 0, 0],
            [0, f, 0, 0],
            [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
            [0, 0, -1, 0],
        ]
    )
    eye = np.array(camera.eye)
    forward = np.array(camera.target) - eye
    forward /= np.linalg.norm(forward)
    side = np.cross(forward, np.array(camera.up) / np.linalg.norm(camera.up))
    side /= np.linalg.norm(side)
    rotation, translation = np.eye(4), np.eye(4)
    rotation[:3, :3] = np.stack([side, np.cross(side, forward), -forward])
    translation[:3, 3] = -eye
    return np.asarray(perspective @ rotation @ translation)


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_a_point_on_a_pixel_s_ray_is_drawn_in_that_pixel(camera: Camera, size: tuple[int, int]) -> None:
    view = view_of(BOX, camera, size)
    centres = pixel_centres(*size)
    for distance in (0.5, 3.0, 100.0):
        drawn = projected(view.projection_view, view.eye + distance * ray_directions(view, centres, size))
        np.testing.assert_allclose((drawn[:, :2] + 1) / 2 * size, centres, atol=1e-6)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_the_matrix_is_the_textbook_s(camera: Camera) -> None:
    view = view_of(BOX, camera, (120, 50))
    expected = look_at(camera, 120 / 50, view.near, view.far)
    np.testing.assert_allclose(view.projection_view, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_the_depth_planes_hold_all_that_is_seen(camera: Camera) -> None:
    view = view_of(BOX, camera, (64, 64))
    depth = (BOX.triangles.reshape(-1, 3).astype(np.float64) - view.eye) @ view.forward
    assert 0 < view.near < view.far
    assert depth.max() <= view.far
    assert view.near <= max(depth.min(), 5e-4 * view.far)


def test_the_field_of_view_is_vertical() -> None:
    view = view_of(BOX, replace(BOX.camera, fov=90.0), (200, 100))
    assert np.linalg.norm(view.up) == pytest.approx(1.0)
    assert np.linalg.norm(view.right) == pytest.approx(2.0)


@pytest.mark.parametrize(
    "camera",
    [
        Camera((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 60.0),
        Camera((0.0, 0.0, 0.0), (0.0, 2.0, 0.0), 60.0),
        Camera((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0),
        Camera((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 180.0),
        Camera((math.nan, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0),
        Camera((0.0, 0.0, 0.0), (0.0, 0.0, math.inf), 60.0),
    ],
    ids=["eye on target", "along up", "no field", "half the world", "nan", "inf"],
)
def test_a_camera_that_looks_nowhere_is_refused(camera: Camera) -> None:
    with pytest.raises(SceneError, match="The camera looks nowhere"):
        view_of(BOX, camera, (64, 64))
