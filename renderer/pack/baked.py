"""Triangles made ready beforehand for `shaders/intersector_baked.glsl` (Baldwin and Weber 2016)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[np.uint32]
Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

WORDS = 16
"""Of a triangle."""


@np.errstate(over="ignore", invalid="ignore")
def bake(triangles: Floats, order: Ints | None) -> Words:
    """Triangles (m, 3, 3) in `order` (slot -> triangle, at most 2^30 of them), WORDS words each.

    k is the axis along which the normal is longest; i and j follow it cyclically. A triangle's words: w_i, w_j, w; its
    id, shifted over k; u_i, u_j, u; v_i, v_j, v; lower; upper. The plane is p_k + w_i p_i + w_j p_j + w = 0, and
    u_i p_i + u_j p_j + u and v_i p_i + v_j p_j + v are the coordinates along its sides from the first corner. Found
    in float64 and rounded. Degenerate triangles get coordinates below 0; a number too large for float32 is infinite,
    and so is what the shader makes of it: neither is hit.
    """
    ids = np.arange(len(triangles), dtype=np.int32) if order is None else order
    chosen = triangles[ids]
    kept, plane, across, along = _rows(chosen.astype(np.float64))
    words = np.empty((len(ids), WORDS), np.uint32)
    words[:, :3] = _bits(plane)
    words[:, 3] = ids.astype(np.uint32) << 2 | kept.astype(np.uint32)
    words[:, 4:10] = _bits(np.hstack([across, along]))
    words[:, 10:13], words[:, 13:] = _bits(chosen.min(axis=1)), _bits(chosen.max(axis=1))
    return words.ravel()


def _rows(corners: Doubles) -> tuple[npt.NDArray[np.intp], Doubles, Doubles, Doubles]:
    """The kept axis (m,), and the rows of w, u and v, (m, 3) each, of triangles (m, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept = np.abs(normal).argmax(axis=1)
    cyclic = (kept[:, None] + np.arange(3)) % 3
    n = np.take_along_axis(normal, cyclic, axis=1)
    a, b, c = np.take_along_axis(corners, cyclic[:, None, :], axis=2).transpose(1, 0, 2)
    flat = n[:, 0] == 0.0
    n[flat] = [1.0, 0.0, 0.0]
    plane = np.column_stack([n[:, 1], n[:, 2], -(n * a).sum(axis=1)]) / n[:, :1]
    across, along = _side(a, c) / n[:, :1], -_side(a, b) / n[:, :1]
    across[flat], along[flat] = [0.0, 0.0, -1.0], 0.0
    return kept, plane, across, along


def _side(a: Doubles, b: Doubles) -> Doubles:
    """The row in i and j that is 0 on the line from a to b, and at the third corner twice the triangle's area."""
    i, j = b[:, 2] - a[:, 2], a[:, 1] - b[:, 1]
    return np.column_stack([i, j, -(i * a[:, 1] + j * a[:, 2])])


def _bits(values: npt.NDArray[np.floating]) -> Words:
    words: Words = np.ascontiguousarray(values, np.float32).view(np.uint32)
    return words
