"""The rays as cast are the camera's and the lights', by the definitions in float64."""

from __future__ import annotations

import numpy as np
import pytest
from hand_made import SCENES, scene, wall
from running import WALKS, run

from renderer.pack.primitives import face_normals
from renderer.records import Records
from renderer.variant import AXES, Variant
from renderer.view import view_of
from scenes.scene import Scene

SIZE = (45, 31)
OFFSET = 1e-4


def traced(made: Scene, method: str) -> Records:
    return run(made, Variant("bvh-stack", method), SIZE).records


@pytest.mark.parametrize("method", AXES["method"])
@pytest.mark.parametrize("name", ["soup seed 12", "along -y", "far from the origin"])
def test_primary_rays_run_through_the_middles_of_their_pixels(name: str, method: str) -> None:
    made = SCENES[name]()
    rays = traced(made, method).primary
    view = view_of(made, made.camera, SIZE)
    x, y = np.meshgrid((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1, (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2 - 1)
    expected = view.forward + x.reshape(-1, 1) * view.right + y.reshape(-1, 1) * view.up
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(rays.direction, expected, atol=1e-6)
    np.testing.assert_array_equal(rays.origin, np.tile(np.float32(view.eye), (len(rays), 1)))


@pytest.mark.parametrize("method", ["fragment", "compute"])
@pytest.mark.parametrize("name", ["soup seed 12", "two lights", "inside a cube"])
def test_shadow_rays_run_from_each_hit_to_each_light(name: str, method: str) -> None:
    made = SCENES[name]()
    records = traced(made, method)
    hits = np.flatnonzero(records.hits.primitive >= 0)
    lights = len(made.lights)
    np.testing.assert_array_equal(records.shadow_pixel, np.repeat(hits, lights))
    np.testing.assert_array_equal(records.shadow_light, np.tile(np.arange(lights), len(hits)))
    towards_eye = -records.primary.direction[records.shadow_pixel].astype(np.float64)
    normal = face_normals(made.triangles)[records.hits.primitive[records.shadow_pixel]]
    normal *= np.where((normal * towards_eye).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    point = np.array(made.camera.eye) - records.hits.t[records.shadow_pixel, None] * towards_eye
    origin = point + OFFSET * made.diagonal * normal
    np.testing.assert_allclose(records.shadow.origin, origin, atol=2e-5 * made.diagonal)
    assert ((records.shadow.origin - point) * normal).sum(axis=1).min() > 0
    way = np.array(made.lights)[records.shadow_light] - records.shadow.origin
    distance = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(records.shadow.reach, distance, rtol=1e-6)
    np.testing.assert_allclose(records.shadow.direction, way / distance[:, None], atol=1e-6)


@pytest.mark.parametrize("traversal", ["brute-force", *WALKS])
@pytest.mark.parametrize("eye", [(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0), (0.0, 0.0), (1.0, 1.0)], ids=str)
def test_a_ray_in_the_plane_of_a_box_s_face_is_inside(eye: tuple[float, float], traversal: str) -> None:
    """The middle ray does not move along x or y and runs along the square's rim, which belongs to it."""
    square = scene("square", wall(cells=2), (*eye, 4.0), (*eye, 0.0))
    records = run(square, Variant(traversal), (33, 33)).records
    middle = 16 * 33 + 16
    np.testing.assert_array_equal(records.primary.direction[middle], [0.0, 0.0, -1.0])
    assert records.hits.primitive[middle] >= 0
    assert records.hits.t[middle] == 4.0
