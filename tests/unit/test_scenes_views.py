"""Every catalogue camera sees its scene, and its light is in the open."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from scenes import catalogue
from scenes.load import load
from scenes.mesh import Mesh
from scenes.procedural import statue
from scenes.scene import Camera, Scene
from scenes.view import automatic_camera, automatic_light

# Fixed by the design, not by us: the Buddha's slim figure fills a fifth of its picture.
SLIM = 0.15


def primary_rays(camera: Camera, side: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    eye = np.array(camera.eye)
    forward = np.array(camera.target) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    step = ((np.arange(side) + 0.5) / side * 2 - 1) * np.tan(np.radians(camera.fov / 2))
    across, down = np.meshgrid(step, -step)
    rays = forward + across[..., None] * right + down[..., None] * up
    directions = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3)
    return np.tile(eye, (side * side, 1)).astype(np.float32), directions.astype(np.float32)


def hit_and_lit_shares(scene: Scene, side: int = 64) -> tuple[float, float]:
    """The share of primary rays that hit, and the share of those hits that see the first light."""
    embree = rtcore_scene.EmbreeScene()
    TriangleMesh(embree, scene.triangles)
    origins, directions = primary_rays(scene.camera, side)
    found = embree.run(origins, directions, query="INTERSECT", output=1)
    hit = found["primID"] >= 0
    points = origins[hit] + directions[hit] * (found["tfar"][hit, None] * (1 - 1e-4))
    towards = np.array(scene.lights[0], dtype=np.float32) - points
    blocked = embree.run(points, towards, np.ones(len(points), np.float32), query="OCCLUDED") >= 0
    return float(hit.mean()), float(1.0 - blocked.mean())


@pytest.mark.parametrize("name", catalogue.ENTRIES)
def test_catalogue_camera_and_light(name: str) -> None:
    if not catalogue.is_here(catalogue.find(name)):
        pytest.skip(f"{name} is not in the folders of RAYFARM_SCENES")
    scene = load(name)
    hit, lit = hit_and_lit_shares(scene)
    assert hit > (SLIM if name.startswith("happy") else 0.3)
    assert 0.2 < lit < 0.95


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_automatic_camera_holds_the_whole_object(scale: float) -> None:
    mesh = statue(2_000)
    vertices = (mesh.vertices * np.float32(scale)).astype(np.float32)
    camera = automatic_camera(vertices, mesh.faces)
    forward = np.array(camera.target) - np.array(camera.eye)
    forward /= np.linalg.norm(forward)
    away = vertices.astype(np.float64) - np.array(camera.eye)
    depth = away @ forward
    half_angle = np.degrees(np.arctan2(np.linalg.norm(away - depth[:, None] * forward, axis=1), depth))
    assert half_angle.max() < camera.fov / 2
    light = automatic_light(vertices, mesh.faces)
    scene = Scene("statue", vertices, mesh.faces, None, camera, (light,))
    hit, lit = hit_and_lit_shares(scene)
    assert hit > 0.1
    assert 0.2 < lit < 0.95


def test_automatic_camera_of_a_single_point() -> None:
    flat = Mesh(np.ones((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    camera = automatic_camera(flat.vertices, flat.faces)
    assert camera.eye != camera.target
