"""What a hit looks like, as shaders/render_pixel.glsl and surface_cast.glsl shade it, in float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.records import Flags, Ints, Rays
from scenes.scene import Scene

Doubles = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

BACKGROUND = (0.02, 0.03, 0.05)
AMBIENT, DIFFUSE = 0.08, 0.92


def picture(size: tuple[int, int], hit: Flags, grey: Doubles) -> Image:
    """(h, w, 3), row 0 at the bottom: the `grey` (n,) of the pixels that are `hit` (h*w,), the background elsewhere."""
    colour = np.tile(BACKGROUND, (len(hit), 1))
    colour[hit] = grey[:, None]
    made: Image = np.rint(np.sqrt(colour) * 255).astype(np.uint8)
    return made.reshape(size[1], size[0], 3)


def distance_grey(scene: Scene, t: Doubles) -> Doubles:
    """Of hits at `t` (n,), where primary rays alone are traced."""
    grey: Doubles = scene.diagonal / (scene.diagonal + t)
    return grey


def lit_grey(scene: Scene, light: Doubles) -> Doubles:
    """Of hits that get so much of all lights together, (n,)."""
    return AMBIENT + DIFFUSE * light / len(scene.lights)


def points_of(rays: Rays, t: Doubles) -> Doubles:
    """Where the rays hit, (n, 3)."""
    points: Doubles = rays.origin + t[:, None] * rays.direction.astype(np.float64)
    return points


def normals_of(scene: Scene, rays: Rays, points: Doubles, primitive: Ints) -> tuple[Doubles, Doubles]:
    """Of the triangles that were hit at `points`, and those that shade there, (n, 3) each, unit, towards the eye.

    The second are the vertices', by barycentric coordinates, where the scene has some; else the first.
    """
    corners = scene.triangles[primitive].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face = _facing(normal, -rays.direction)
    if scene.normals is None:
        return face, face
    a, b, c = (corners[:, k] - points for k in range(3))
    weights = np.stack([dot(np.cross(p, q), normal) for p, q in ((b, c), (c, a), (a, b))], axis=1)
    weights /= dot(normal, normal)[:, None]
    between = np.einsum("nk,nkj->nj", weights, scene.normals[scene.faces[primitive]].astype(np.float64))
    return face, _facing(between, -rays.direction)


def unit(vectors: Doubles) -> Doubles:
    """Vectors (n, 3) of length 1; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    made: Doubles = vectors / np.where(length > 0, length, 1.0)
    return made


def dot(a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> Doubles:
    """Row by row, (n,)."""
    product: Doubles = np.einsum("nj,nj->n", a, b)
    return product


def _facing(normal: Doubles, towards: npt.NDArray[np.floating]) -> Doubles:
    """Unit normals, on the side that faces `towards`."""
    return unit(normal) * np.where(dot(normal, towards) < 0, -1.0, 1.0)[:, None]
