"""Triangles into primitive buffers: the paper's three layouts (section 3.1), and what is left without normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from renderer.build.parallel import blocks, each

Words = npt.NDArray[np.uint32]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class PackedPrimitives:
    """Primitive buffers: `vertices` uint32 words, and what has a buffer of its own: `normals`, `baked` triangles."""

    vertices: Words
    normals: Words | None
    baked: Words | None = None

    @property
    def nbytes(self) -> int:
        """The bytes of all."""
        return sum(words.nbytes for words in (self.vertices, self.normals, self.baked) if words is not None)


@dataclass(frozen=True, eq=False)
class Corners:
    """What triangles' corners have, places or normals: those of triangle t are `values[rows[t]]` of `values` (n, 3)."""

    values: Floats
    rows: Ints


def pack_primitives(places: Corners, normals: Corners | None, order: Ints | None, layout: str) -> PackedPrimitives:
    """Lay triangles and their corners' normals out in `order` (slot -> triangle).

    Without normals every layout is the same three padded vertices. The scene's triangle id lies in padding.
    """
    ids = np.arange(len(places.rows), dtype=np.int32) if order is None else order
    inside = normals is not None and layout != "split"
    compact = inside and layout == "compact"
    words = np.zeros((len(ids), 5 if compact else 6 if inside else 3, 4), np.uint32)
    apart = None if normals is None or inside else np.zeros((len(ids), 3, 4), np.uint32)

    def lay_out(block: slice) -> None:
        own, own_ids = words[block], ids[block]
        # -0.0 becomes 0.0, as in `unsigned_zeros`.
        own.view(np.float32)[:, :3, :3] = places.values[places.rows[own_ids]] + np.float32(0.0)
        own[:, 3 if compact else 0, 3] = own_ids
        if normals is None:
            return
        shading = normals.values[normals.rows[own_ids]].view(np.uint32)
        if apart is not None:
            apart[block, :, :3] = shading
        elif compact:
            own[:, :3, 3], own[:, 3:, :3] = shading[:, 0], shading[:, 1:]
        else:
            own[:, 3:, :3] = shading

    each([partial(lay_out, block) for block in blocks(len(ids))])
    return PackedPrimitives(words.ravel(), None if apart is None else apart.ravel())


def pack_raster(triangles: Floats, corner_normals: Floats | None) -> Words:
    """The hybrid method's vertex buffer: position and octahedral normal of every corner, 4 words each."""
    words = np.empty((len(triangles) * 3, 4), np.uint32)
    words[:, :3] = _bits(triangles).reshape(-1, 3)
    if corner_normals is None:
        words[:, 3] = np.repeat(octahedral(face_normals(triangles)), 3)
    else:
        words[:, 3] = octahedral(corner_normals.reshape(-1, 3))
    return words.ravel()


def face_normals(triangles: Floats) -> npt.NDArray[np.float64]:
    """Unit normals (m, 3) of triangles (m, 3, 3); of a degenerate triangle, z."""
    corners = triangles.astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1, keepdims=True)
    return np.where(length > 0, cross / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])


def octahedral(normals: npt.NDArray[np.floating]) -> Words:
    """Unit vectors (n, 3) in 32 bits each, as `shaders/common_octahedral.glsl` decodes them."""
    n = normals.astype(np.float64)
    p = n[:, :2] / np.abs(n).sum(axis=1, keepdims=True)
    folded = (1.0 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1.0, -1.0)
    snorm = np.rint(np.clip(np.where(n[:, 2:] < 0, folded, p), -1, 1) * 32767).astype(np.int64) & 0xFFFF
    codes: Words = (snorm[:, 0] | (snorm[:, 1] << 16)).astype(np.uint32)
    return codes


def unsigned_zeros(values: npt.NDArray[np.generic]) -> Words:
    """The words of float32 coordinates, -0.0 as 0.0: the slab test takes a face at -0.0 for one behind a ray at 0.0."""
    words: Words = (np.asarray(values, np.float32) + np.float32(0.0)).view(np.uint32)
    return words


def _bits(values: Floats) -> Words:
    words: Words = np.ascontiguousarray(values, np.float32).view(np.uint32)
    return words
