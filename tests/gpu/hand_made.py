"""Small scenes that are hard on traversals, each by name; seeds are in the names."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from scenes.scene import Camera, Point, Scene

Triangles = npt.NDArray[np.float32]

ABOVE = (0.3, 2.5, 0.7)


def scene(
    name: str,
    triangles: npt.ArrayLike,
    eye: Point = (0.4, 0.5, 3.0),
    target: Point = (0.5, 0.5, 0.5),
    fov: float = 40.0,
    *,
    up: Point = (0.0, 1.0, 0.0),
    lights: tuple[Point, ...] = (ABOVE,),
) -> Scene:
    """A scene over triangles (m, 3, 3) that share no vertices."""
    corners = np.asarray(triangles, np.float32).reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return Scene(name, corners, faces, None, Camera(eye, target, fov, up), lights)


def soup(number: int, seed: int, size: float = 0.3) -> Triangles:
    """Random triangles in and around the unit cube."""
    rng = np.random.default_rng(seed)
    return (rng.random((number, 1, 3)) + size * (rng.random((number, 3, 3)) - 0.5)).astype(np.float32)


def cubes(side: int) -> Triangles:
    """A lattice of unit cubes on every other whole coordinate: faces and KD planes lie on whole numbers."""
    low = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    high = low + np.array([0, 0, 1])
    quads = [np.roll(quad, axis, axis=1) for axis, quad in itertools.product(range(3), (low, high))]
    one = np.concatenate([[quad[[0, 1, 2]], quad[[0, 2, 3]]] for quad in quads])
    corners = 2 * np.stack(np.meshgrid(*[np.arange(side)] * 3), axis=-1).reshape(-1, 1, 1, 3)
    return (one[None] + corners).reshape(-1, 3, 3).astype(np.float32)


def wall(z: float = 0.0, *, cells: int = 1) -> Triangles:
    """The unit square at that z, in 2 cells^2 triangles."""
    step = 1 / cells
    corner = np.stack([*np.meshgrid(np.arange(cells), np.arange(cells)), np.zeros((cells, cells))], axis=-1)
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]])
    placed = (square[None] + corner.reshape(-1, 1, 1, 3)) * [step, step, 1.0] + [0.0, 0.0, z]
    return placed.reshape(-1, 3, 3).astype(np.float32)


def with_degenerates(seed: int) -> Triangles:
    """A soup with points, lines, and triangles that fold back onto themselves among the rest."""
    rng = np.random.default_rng(seed)
    mixed = soup(200, seed)
    mixed[::4] = mixed[::4, :1]
    mixed[1::8, 2] = mixed[1::8, 1]
    mixed[5::8, 2] = (mixed[5::8, 0] + mixed[5::8, 1]) / 2
    return np.asarray(rng.permutation(mixed), np.float32)


def progression(number: int) -> Triangles:
    """Ever smaller triangles towards the origin: SAH splits off one or two at a time, so that the tree is deep."""
    scale = (0.5 ** np.arange(number)).reshape(-1, 1, 1)
    one = np.array([[1.0, 0.1, -0.3], [0.7, 0.9, 0.2], [0.6, 0.2, 0.4]])
    return np.asarray(one * scale, np.float32)


def stacked(number: int) -> Triangles:
    """Half squares behind each other, which a ray through their other half passes by, and a square last."""
    z = -np.arange(number, dtype=np.float64) / number
    half = np.repeat(wall()[:1], number, axis=0)
    half[:, :, 2] = z[:, None]
    return np.concatenate([half, wall(-1.25)])


def duplicates(number: int) -> Triangles:
    """One large triangle, many times."""
    return np.repeat(np.array([[[-9, -9, 0], [9, -9, 0], [0, 18, 0]]], np.float32), number, axis=0)


def random_scene(seed: int) -> Scene:
    """30 to 1920 random triangles."""
    return scene(f"soup {seed}", soup(30 * 4 ** (seed % 4), seed))


def moved(name: str, scale: float, offset: Point) -> Scene:
    """A soup scaled, then moved, with its camera and light."""

    def place(point: Point) -> Point:
        x, y, z = (scale * p + o for p, o in zip(point, offset, strict=True))
        return (x, y, z)

    triangles = soup(300, 5) * np.float64(scale) + offset
    eye, target = place((0.4, 0.5, 3.0)), place((0.5, 0.5, 0.5))
    return scene(name, triangles, eye, target, lights=(place(ABOVE),))


def along(axis: str, *, fov: float = 60.0) -> Scene:
    """Cubes on whole numbers seen along an axis, from an eye in the planes of their faces."""
    sign = -1.0 if axis[0] == "-" else 1.0
    k = "xyz".index(axis[1])
    eye, target, up = [3.0] * 3, [3.0] * 3, [0.0] * 3
    eye[k], up[(k + 1) % 3] = 3.0 - 8.0 * sign, 1.0
    light = tuple(4.0 if i == k else 9.0 for i in range(3))
    return scene(
        f"along {axis} fov {fov}", cubes(3), _point(eye), _point(target), fov, up=_point(up), lights=(_point(light),)
    )


def _point(values: list[float] | tuple[float, ...]) -> Point:
    x, y, z = values
    return (x, y, z)


def light_on_the_surface() -> Scene:
    """A light in the plane of what it lights, and one where the shadow ray of the centre's hit begins."""
    made = scene("light on the surface", wall(0.0, cells=2), (0.25, 0.375, 4.0), (0.25, 0.375, 0.0))
    begin = (0.25, 0.375, float(np.float32(made.diagonal * 1e-4)))
    return scene(made.name, made.triangles, made.camera.eye, made.camera.target, lights=((5.0, 0.375, 0.0), begin))


SCENES: dict[str, Callable[[], Scene]] = {
    "one triangle": lambda: scene("one triangle", soup(1, 3, size=2.0)),
    "two duplicates": lambda: scene("two duplicates", duplicates(2)),
    "200 duplicates": lambda: scene("200 duplicates", duplicates(200)),
    "duplicates in a soup": lambda: scene("duplicates in a soup", np.repeat(soup(40, 8), 7, axis=0)),
    "nothing in view": lambda: scene("nothing in view", soup(300, 1), (0.5, 0.5, 3.0), (0.5, 0.5, 6.0)),
    "flat": lambda: scene("flat", wall(cells=9), lights=((0.2, 0.3, 1.0), (0.5, 0.5, -1.0))),
    "flat, seen from its edge": lambda: scene("edge on", wall(cells=9), (0.5, 3.0, 0.0), (0.5, 0.5, 0.0), up=(0, 0, 1)),
    "degenerates seed 2": lambda: scene("degenerates", with_degenerates(2)),
    "only degenerates": lambda: scene("only degenerates", np.repeat(soup(20, 4)[:, :1], 3, axis=1)),
    "inside a soup": lambda: scene("inside a soup", soup(500, 6), (0.5, 0.5, 0.5), (0.9, 0.6, 0.1), 100.0),
    "inside a cube": lambda: scene("inside a cube", cubes(1), (0.5, 0.5, 0.5), (0.5, 0.5, 0.0), 90.0),
    "eye on a face": lambda: scene("eye on a face", cubes(3), (2.5, 2.5, 3.0), (2.5, 2.5, 0.0), 90.0),
    **{f"soup seed {seed}": partial(random_scene, seed) for seed in (10, 11, 12, 13)},
    **{f"along {axis}": partial(along, axis) for axis in ("+x", "-x", "+y", "-y", "+z", "-z")},
    "rays all but parallel": lambda: along("-z", fov=1e-30),
    "rays about as still as counts": lambda: along("-z", fov=2e-22),
    "far from the origin": lambda: moved("far", 1.0, (1e5, -1e5, 1e5)),
    "tiny": lambda: moved("tiny", 1e-6, (0.0, 0.0, 0.0)),
    "large": lambda: moved("large", 1e6, (0.0, 0.0, 0.0)),
    "two lights": lambda: scene("two lights", soup(300, 7), lights=(ABOVE, (-2.0, 0.5, 1.0))),
    "light on the surface": light_on_the_surface,
    "deep": lambda: scene("deep", progression(30), (0.9, 0.8, 2.0), (0.1, 0.1, 0.0)),
}
