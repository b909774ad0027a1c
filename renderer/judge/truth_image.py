"""The image without rounding: exact hits, float64 shading, shadow rays that begin on the surface itself.

Rays are rounded to float32 once, so that the referee can decide their hits exactly; everything after that is float64
(`renderer.judge.shading`), and the picture is rounded to 8 bits at the end. What an offset of shadow rays, a smaller
node format or a rasteriser does to the picture is therefore in its difference.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from renderer.build.tree import Bvh
from renderer.judge import referee
from renderer.judge.shading import Doubles, Image, distance_grey, dot, lit_grey, normals_of, picture, points_of, unit
from renderer.records import Flags, Floats, Ints, Rays
from renderer.view import view_of
from scenes.kept import cache_folder, kept, key_of
from scenes.scene import Camera, Scene

VERSION = 1
"""Part of every kept picture's key: raise it with any change to what is drawn."""

ON_SURFACE = 2.0**-18
"""What a ray from the light hits this near the point, relative to the way, is the surface that the point lies on."""


def truth_image(
    scene: Scene, bvh: Bvh, size: tuple[int, int], camera: Camera | None = None, rays: str = "both"
) -> Image:
    """The picture of a request with these values, (h, w, 3), row 0 at the bottom; `bvh` is over the scene's triangles.

    With `rays` "primary" nothing is shaded and the picture shows distances, as the request's does. It is kept on disk:
    all variants of a scene are held against the same one.
    """
    looking = camera or scene.camera
    key = key_of(scene.key, looking, scene.lights, size, "primary" if rays == "primary" else "shaded", VERSION)

    def read(file: BinaryIO) -> Image:
        with np.load(file, allow_pickle=False) as entry:
            drawn: Image = entry["picture"]
            return drawn

    def write(file: BinaryIO, drawn: Image) -> None:
        np.savez_compressed(file, picture=drawn)

    return kept(cache_folder("pictures") / f"{key}.npz", read, lambda: _drawn(scene, bvh, size, looking, rays), write)


def _drawn(scene: Scene, bvh: Bvh, size: tuple[int, int], camera: Camera, rays: str) -> Image:
    primary = _primary(scene, camera, size)
    found = referee.closest(scene.triangles, primary, bvh)
    hit = found.primitive >= 0
    if rays == "primary":
        return picture(size, hit, distance_grey(scene, found.t[hit]))
    return picture(size, hit, _shaded(scene, bvh, primary[hit], found.t[hit], found.primitive[hit]))


def _primary(scene: Scene, camera: Camera, size: tuple[int, int]) -> Rays:
    """The rays through the pixels' centres, from the camera as the shaders are given it."""
    view = view_of(scene, camera, size)
    eye, forward, right, up = (
        v.astype(np.float32).astype(np.float64) for v in (view.eye, view.forward, view.right, view.up)
    )
    x, y = ((np.arange(n) + 0.5) * 2 / n - 1 for n in size)
    direction = (forward + x[None, :, None] * right + y[:, None, None] * up).reshape(-1, 3)
    origin = np.broadcast_to(eye.astype(np.float32), direction.shape).copy()
    return Rays(origin, unit(direction).astype(np.float32), np.full(len(direction), np.finfo(np.float32).max))


def _shaded(scene: Scene, bvh: Bvh, rays: Rays, t: Doubles, primitive: Ints) -> Doubles:
    """The grey of each hit, (n,)."""
    point = points_of(rays, t)
    face, normal = normals_of(scene, rays, point, primitive)
    light = np.zeros(len(t))
    for position in np.array(scene.lights, np.float32):
        way = unit(position - point)
        lit = (dot(face, way) > 0) & ~_hidden(scene, bvh, position, point, primitive)
        light += np.where(lit, np.maximum(dot(normal, way), 0), 0)
    return lit_grey(scene, light)


def _hidden(scene: Scene, bvh: Bvh, light: Floats, point: Doubles, primitive: Ints) -> Flags:
    """Whether something lies between the light and each point, other than the triangle that the point lies on."""
    way = (point - light).astype(np.float32)
    rays = Rays(np.broadcast_to(light, way.shape).copy(), way, np.ones(len(way), np.float32))
    found = referee.closest(scene.triangles, rays, bvh)
    hidden: Flags = (found.t < 1 - ON_SURFACE) & (found.primitive != primitive)
    return hidden
