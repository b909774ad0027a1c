"""Boxes a little larger than their triangles, which the KD-tree is built over."""

from __future__ import annotations

import numpy as np

from renderer.build.tree import Floats
from renderer.jit import jit

PAD = 2.0**-17
"""Of the largest side of the box around all."""

PAD_PLACE = 2.0**-22
"""Of the largest |coordinate|: two float32 steps there."""


def pad_of(boxes: Floats) -> float:
    """How far `padded` moves every side of `boxes` (m, 2, 3) float32, at least."""
    side, place = extent(boxes)
    return PAD * side + PAD_PLACE * place


def extent(boxes: Floats) -> tuple[float, float]:
    """The largest side of the box around all, and the largest |coordinate|."""
    low, high = around(boxes)
    return float((high.astype(np.float64) - low).max()), float(max(np.abs(low).max(), np.abs(high).max()))


@jit
def around(boxes: Floats) -> tuple[Floats, Floats]:
    """The corners of the box around all, (3,) each."""
    low, high = np.full(3, np.float32(np.inf)), np.full(3, np.float32(-np.inf))
    for i in range(len(boxes)):
        for k in range(3):
            low[k], high[k] = min(low[k], boxes[i, 0, k]), max(high[k], boxes[i, 1, k])
    return low, high


def padded(boxes: Floats) -> Floats:
    """`boxes` (m, 2, 3) float32, larger on every side by at least `pad_of` them.

    A hit's position is computed in float32 and can lie just outside of its triangle's bounds; with these it lies
    inside the cells that hold the triangle, for rays that start up to twice the largest side away from the scene
    (ARCHITECTURE.md, Why no traversal loses a hit). And a plane of the tree, which is a face of one of these boxes,
    never lies on that triangle's true bounds. Rounded outward: never less than asked.
    """
    # The last factor outweighs the rounding of the float64 sums; the least pad gives a point at 0 a cell with width.
    pad = max(pad_of(boxes) * (1.0 + 2.0**-20), float(np.finfo(np.float32).tiny))
    return _moved_out(boxes, pad)


@jit
def _moved_out(boxes: Floats, pad: float) -> Floats:
    moved = np.empty_like(boxes)
    for i in range(len(boxes)):
        for k in range(3):
            low, high = np.float64(boxes[i, 0, k]) - pad, np.float64(boxes[i, 1, k]) + pad
            moved[i, 0, k] = -_rounded_up(-low)
            moved[i, 1, k] = _rounded_up(high)
    return moved


@jit
def _rounded_up(value: float) -> np.float32:
    """The least float32 that is not below `value`."""
    nearest = np.float32(value)
    return nearest if nearest >= value else np.nextafter(nearest, np.float32(np.inf))
