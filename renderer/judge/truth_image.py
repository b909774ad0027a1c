"""The image without rounding: exact hits, float64 shading, shadow rays that begin on the surface itself.

It shades as shaders/render_pixel.glsl and surface_cast.glsl do. Rays are rounded to float32 once, so that the referee
can decide their hits exactly; everything after that is float64, and the picture is rounded to 8 bits at the end. What
an offset of shadow rays, a smaller node format or a rasteriser does to the picture is therefore in its difference.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Bvh
from renderer.judge import referee
from renderer.records import Flags, Floats, Ints, Rays
from renderer.view import view_of
from scenes.kept import cache_folder, kept, key_of
from scenes.scene import Camera, Scene

Doubles = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

VERSION = 1
"""Part of every kept picture's key: raise it with any change to what is drawn."""

BACKGROUND = (0.02, 0.03, 0.05)
AMBIENT, DIFFUSE = 0.08, 0.92

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
            picture: Image = entry["picture"]
            return picture

    def write(file: BinaryIO, picture: Image) -> None:
        np.savez_compressed(file, picture=picture)

    return kept(cache_folder("pictures") / f"{key}.npz", read, lambda: _drawn(scene, bvh, size, looking, rays), write)


def _drawn(scene: Scene, bvh: Bvh, size: tuple[int, int], camera: Camera, rays: str) -> Image:
    primary = _primary(scene, camera, size)
    found = referee.closest(scene.triangles, primary, bvh)
    hit = found.primitive >= 0
    colour = np.tile(BACKGROUND, (len(primary), 1))
    if rays == "primary":
        colour[hit] = (scene.diagonal / (scene.diagonal + found.t[hit]))[:, None]
    else:
        colour[hit] = _shaded(scene, bvh, primary[hit], found.t[hit], found.primitive[hit])[:, None]
    picture: Image = np.rint(np.sqrt(colour) * 255).astype(np.uint8)
    return picture.reshape(size[1], size[0], 3)


def _primary(scene: Scene, camera: Camera, size: tuple[int, int]) -> Rays:
    """The rays through the pixels' centres, from the camera as the shaders are given it."""
    view = view_of(scene, camera, size)
    eye, forward, right, up = (
        v.astype(np.float32).astype(np.float64) for v in (view.eye, view.forward, view.right, view.up)
    )
    x, y = ((np.arange(n) + 0.5) * 2 / n - 1 for n in size)
    direction = (forward + x[None, :, None] * right + y[:, None, None] * up).reshape(-1, 3)
    origin = np.broadcast_to(eye.astype(np.float32), direction.shape).copy()
    return Rays(origin, _unit(direction).astype(np.float32), np.full(len(direction), np.finfo(np.float32).max))


def _shaded(scene: Scene, bvh: Bvh, rays: Rays, t: Doubles, primitive: Ints) -> Doubles:
    """The grey of each hit, (n,)."""
    towards_eye = -rays.direction.astype(np.float64)
    point = rays.origin - t[:, None] * towards_eye
    corners = scene.triangles[primitive].astype(np.float64)
    face = _facing(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), towards_eye)
    normal = face if scene.normals is None else _facing(_interpolated(scene, corners, point, primitive), towards_eye)
    light = np.zeros(len(t))
    for position in np.array(scene.lights, np.float32):
        way = _unit(position - point)
        lit = (_dot(face, way) > 0) & ~_hidden(scene, bvh, position, point, primitive)
        light += np.where(lit, np.maximum(_dot(normal, way), 0), 0)
    return AMBIENT + DIFFUSE * light / len(scene.lights)


def _hidden(scene: Scene, bvh: Bvh, light: Floats, point: Doubles, primitive: Ints) -> Flags:
    """Whether something lies between the light and each point, other than the triangle that the point lies on."""
    way = (point - light).astype(np.float32)
    rays = Rays(np.broadcast_to(light, way.shape).copy(), way, np.ones(len(way), np.float32))
    found = referee.closest(scene.triangles, rays, bvh)
    hidden: Flags = (found.t < 1 - ON_SURFACE) & (found.primitive != primitive)
    return hidden


def _interpolated(scene: Scene, corners: Doubles, point: Doubles, primitive: Ints) -> Doubles:
    """The vertices' normals, by each point's barycentric coordinates."""
    assert scene.normals is not None
    a, b, c = (corners[:, k] - point for k in range(3))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weights = np.stack([_dot(np.cross(p, q), normal) for p, q in ((b, c), (c, a), (a, b))], axis=1)
    weights /= _dot(normal, normal)[:, None]
    normals: Doubles = np.einsum("nk,nkj->nj", weights, scene.normals[scene.faces[primitive]].astype(np.float64))
    return normals


def _facing(normal: Doubles, towards: Doubles) -> Doubles:
    """Unit normals, on the side that faces `towards`."""
    return _unit(normal) * np.where(_dot(normal, towards) < 0, -1.0, 1.0)[:, None]


def _unit(vectors: Doubles) -> Doubles:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit: Doubles = vectors / np.where(length > 0, length, 1.0)
    return unit


def _dot(a: Doubles, b: Doubles) -> Doubles:
    product: Doubles = np.einsum("nj,nj->n", a, b)
    return product
