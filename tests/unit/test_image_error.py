"""The true image against what can be said by hand, and the two figures of an image's error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from renderer.build.bvh import build_bvh
from renderer.build.tree import Bvh, SahCosts
from renderer.judge.image_error import FlipError, Image, flip, image_error, psnr
from renderer.judge.truth_image import truth_image
from scenes.scene import Camera, Scene, SceneError

SIZE = (33, 21)
EYE = (0.2, 0.1, 3.0)
LIGHT = (1.0, 2.0, 2.5)
FLOOR = np.array([[[-9, -9, 0], [9, -9, 0], [0, 18, 0]]], np.float32)
BACKGROUND = [round(255 * math.sqrt(x)) for x in (0.02, 0.03, 0.05)]
DARK = round(255 * math.sqrt(0.08))


def scene(triangles: np.ndarray, eye: tuple[float, float, float] = EYE) -> Scene:
    corners = triangles.astype(np.float32).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Scene("by hand", corners, faces, None, Camera(eye, (0.0, 0.0, 0.0), 40.0), (LIGHT,))


def tree(made: Scene) -> Bvh:
    corners = made.triangles
    return build_bvh(np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1), SahCosts())


def seen(made: Scene, size: tuple[int, int] = SIZE, rays: str = "both") -> Image:
    return truth_image(made, tree(made), size, rays=rays)


def points(eye: tuple[float, float, float], size: tuple[int, int]) -> np.ndarray:
    """Where the rays through the pixels meet the plane z = 0, (h, w, 3)."""
    forward = -np.array(eye) / np.linalg.norm(eye)
    side = np.cross(forward, (0, 1, 0))
    side /= np.linalg.norm(side)
    half = math.tan(math.radians(20))
    x, y = ((np.arange(n) + 0.5) * 2 / n - 1 for n in size)
    way = (
        forward + x[None, :, None] * half * size[0] / size[1] * side + y[:, None, None] * half * np.cross(side, forward)
    )
    return np.asarray(eye - way * (eye[2] / way[..., 2:]))


def grey(at: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """What a lit point is, 0 to 255 before it is rounded."""
    way = np.array(LIGHT) - at
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    return np.asarray(255 * np.sqrt(0.08 + 0.92 * np.maximum((way * normal).sum(axis=-1), 0)))


def test_a_lit_plane() -> None:
    expected = grey(points(EYE, SIZE), np.array([0, 0, 1]))
    image = seen(scene(FLOOR))
    assert image.shape == (*SIZE[::-1], 3)
    assert (np.abs(image - expected[..., None]) <= 0.501).all()


def test_the_side_away_from_the_light_is_dark_and_nothing_is_the_background() -> None:
    assert (seen(scene(FLOOR, (0.2, 0.1, -3.0))) == DARK).all()
    assert (seen(scene(FLOOR + np.array([0, 0, 9], np.float32))) == BACKGROUND).all()


def test_a_shadow_lies_where_it_must() -> None:
    # A small square half way to the light, out of the camera's sight: its shadow is twice as large.
    square = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]]) * 0.1
    blocker = square + np.array(LIGHT) / 2
    eye = (-2.0, -1.0, 1.0)
    image = seen(scene(np.concatenate([40 * FLOOR, blocker]), eye), (101, 99))
    at = points(eye, (101, 99))
    inside = np.maximum(np.abs(at[..., 0]), np.abs(at[..., 1])) < 0.2
    clear = np.abs(np.maximum(np.abs(at[..., 0]), np.abs(at[..., 1])) - 0.2) > 1e-3
    assert inside.sum() > 50
    assert (image[inside & clear] == DARK).all()
    assert (image[~inside & clear] > DARK).all()


def test_smooth_normals_are_interpolated_and_shade() -> None:
    flat = scene(FLOOR)
    normals = np.array([[-0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0.6, -0.8]], np.float32)
    at = points(EYE, SIZE)
    c = (at[..., 1] + 9) / 27
    b = (at[..., 0] + 9 - 9 * c) / 18
    blend = np.stack([1 - b - c, b, c], axis=-1) @ normals.astype(np.float64)
    blend *= np.where(((np.array(EYE) - at) * blend).sum(axis=-1, keepdims=True) < 0, -1, 1)
    blend /= np.linalg.norm(blend, axis=-1, keepdims=True)
    image = seen(replace(flat, normals=normals))
    assert (np.abs(image - grey(at, blend)[..., None]) <= 0.501).all()
    assert (image != seen(flat)).any()


def test_primary_rays_alone_show_distances() -> None:
    made = scene(FLOOR)
    distance = np.linalg.norm(points(EYE, SIZE) - EYE, axis=-1)
    expected = 255 * np.sqrt(made.diagonal / (made.diagonal + distance))
    assert (np.abs(seen(made, rays="primary") - expected[..., None]) <= 0.501).all()


def test_a_camera_that_looks_nowhere_is_refused() -> None:
    made = scene(FLOOR)
    with pytest.raises(SceneError, match="looks nowhere"):
        truth_image(made, tree(made), SIZE, Camera(EYE, EYE, 40.0))


def noisy(seed: int) -> tuple[Image, Image]:
    rng = np.random.default_rng(seed)
    truth = np.repeat(np.repeat(rng.integers(0, 256, (8, 8, 3), np.uint8), 8, axis=0), 8, axis=1)
    return np.where(rng.random(truth.shape) < 0.1, rng.integers(0, 256, truth.shape, np.uint8), truth), truth


def test_psnr_as_defined() -> None:
    black, white = np.zeros((4, 5, 3), np.uint8), np.full((4, 5, 3), 255, np.uint8)
    assert psnr(white, black) == 0
    assert psnr(np.full((4, 5, 4), 51, np.uint8), black) == pytest.approx(20 * math.log10(5))
    one = black.copy()
    one[1, 2, 0] = 1
    assert psnr(black, black) == psnr(one, black) == pytest.approx(10 * math.log10(255**2 * 60))


def test_flip_is_0_for_the_same_and_grows_with_the_difference() -> None:
    image, truth = noisy(3)
    assert flip(truth, truth) == 0
    slight = np.clip(truth.astype(np.int16) + 1, 0, 255).astype(np.uint8)
    assert 0 < flip(slight, truth) < 0.05 < flip(image, truth) < flip(255 - truth, truth) <= 1
    found = image_error(np.dstack([image, image[..., :1]]), truth)
    assert (found.psnr, found.flip, found.why_no_flip) == (psnr(image, truth), flip(image, truth), "")


def test_flip_is_ended_in_time() -> None:
    image, truth = noisy(4)
    with pytest.raises(FlipError, match=r"was ended after 0\.01 s"):
        flip(image, truth, 0.01)
    found = image_error(image, truth, 0.01)
    assert (found.psnr, found.flip) == (psnr(image, truth), None)
    assert "ended" in found.why_no_flip


def test_images_of_two_sizes_are_refused() -> None:
    image, truth = noisy(5)
    with pytest.raises(ValueError, match="same size"):
        image_error(image[:5], truth)
