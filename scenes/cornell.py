"""The Cornell box from the files beside this module, and things standing in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.mesh import Mesh, read_mesh
from scenes.scene import Floats

DATA = Path(__file__).parent / "data"
# RayFarm's placement (the paper does not give its own): the Buddha in Stanford's frame becomes 1.49 units high
# and stands on the floor in the middle of the box.
BUDDHA_FOOT = (-0.0055, 0.0498, -0.0067)
BUDDHA_SCALE = 7.5


def original_box() -> Mesh:
    """The box with its two blocks, 36 triangles."""
    return read_mesh(DATA / "cornell_box.obj")


def in_empty_box(content: Mesh) -> Mesh:
    """The empty box (the first 12 triangles) with `content` in it."""
    box = read_mesh(DATA / "cornell_empty.obj")
    return Mesh(
        np.concatenate([box.vertices, content.vertices]),
        np.concatenate([box.faces, content.faces + np.int32(len(box.vertices))]),
        note=content.note,
    )


def place_buddha(vertices: Floats) -> Floats:
    """Vertices in Stanford's frame moved into the box, rounded once from float64."""
    placed: Floats = (BUDDHA_SCALE * (vertices.astype(np.float64) - np.array(BUDDHA_FOOT))).astype(np.float32)
    return placed
