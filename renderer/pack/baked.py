"""Triangles made ready beforehand for `shaders/intersector_baked.glsl` (Baldwin and Weber 2016)."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import numpy.typing as npt

Words = npt.NDArray[np.uint32]
Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int32]

WORDS = 16
"""Of a triangle."""

LOST = 2.0**20
"""How much larger what float64 subtracts may be than the difference, which then has 30 digits or more."""


@np.errstate(over="ignore", invalid="ignore")
def bake(triangles: Floats, order: Ints | None) -> Words:
    """Triangles (m, 3, 3) in `order` (slot -> triangle, at most 2^30 of them), WORDS words each.

    k is the axis along which the normal is longest; i and j follow it cyclically. A triangle's words: w_i, w_j, w; its
    id, shifted over k; u_i, u_j, u; v_i, v_j, v; lower; upper. The plane is p_k + w_i p_i + w_j p_j + w = 0, and
    u_i p_i + u_j p_j + u and v_i p_i + v_j p_j + v are the coordinates along its sides from the first corner. Found in
    float64 and rounded; where float64 loses more of a plane than float32 does, found by rationals. Degenerate triangles
    get coordinates below 0; a number too large for float32 is infinite, and so is what the shader makes of it: neither
    is hit.
    """
    ids = np.arange(len(triangles), dtype=np.int32) if order is None else order
    chosen = triangles[ids]
    kept, plane, across, along = _rows(chosen.astype(np.float64))
    for i in np.flatnonzero(_unsure(chosen.astype(np.float64), kept, plane)):
        kept[i], plane[i], across[i], along[i] = _exact_rows(chosen[i])
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


def _unsure(corners: Doubles, kept: npt.NDArray[np.intp], plane: Doubles) -> npt.NDArray[np.bool_]:
    """Which planes (m, 3) may be off by more than 2^-30 of a word: where what was subtracted was far larger."""
    cyclic = (kept[:, None] + np.arange(3)) % 3
    a = np.take_along_axis(corners[:, 0], cyclic, axis=1)
    b, c = (np.abs(np.take_along_axis(corners[:, side] - corners[:, 0], cyclic, axis=1)) for side in (1, 2))
    terms = b[:, [1, 2, 0]] * c[:, [2, 0, 1]] + b[:, [2, 0, 1]] * c[:, [1, 2, 0]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.abs(np.take_along_axis(normal, kept[:, None], axis=1))
    reached = np.abs(a[:, 0]) + np.abs(plane[:, 0] * a[:, 1]) + np.abs(plane[:, 1] * a[:, 2])
    lost = LOST * size < terms.max(axis=1, keepdims=True)
    unsure: npt.NDArray[np.bool_] = (lost[:, 0] | (LOST * np.abs(plane[:, 2]) < reached)) & (size[:, 0] > 0.0)
    return unsure & np.isfinite(size[:, 0])


def _exact_rows(triangle: Floats) -> tuple[int, list[float], list[float], list[float]]:
    """As `_rows`, of one triangle (3, 3) and by rationals."""
    a, b, c = ([Fraction(float(value)) for value in corner] for corner in triangle)
    ab, ac = [y - x for x, y in zip(a, b, strict=True)], [y - x for x, y in zip(a, c, strict=True)]
    normal = [ab[i - 2] * ac[i - 1] - ab[i - 1] * ac[i - 2] for i in range(3)]
    k = max(range(3), key=lambda i: abs(normal[i]))
    i, j = (k + 1) % 3, (k + 2) % 3
    if normal[k] == 0:
        return k, [0.0, 0.0, -float(a[k])], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]
    whole = [normal[i], normal[j], -sum(n * x for n, x in zip(normal, a, strict=True))]
    across = [c[j] - a[j], a[i] - c[i], a[j] * c[i] - a[i] * c[j]]
    along = [a[j] - b[j], b[i] - a[i], a[i] * b[j] - a[j] * b[i]]
    plane, u, v = ([_float(value / normal[k]) for value in row] for row in (whole, across, along))
    return k, plane, u, v


def _float(value: Fraction) -> float:
    """The nearest float64, infinite beyond."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def _side(a: Doubles, b: Doubles) -> Doubles:
    """The row in i and j that is 0 on the line from a to b, and at the third corner twice the triangle's area."""
    i, j = b[:, 2] - a[:, 2], a[:, 1] - b[:, 1]
    return np.column_stack([i, j, -(i * a[:, 1] + j * a[:, 2])])


def _bits(values: npt.NDArray[np.floating]) -> Words:
    words: Words = np.ascontiguousarray(values, np.float32).view(np.uint32)
    return words
