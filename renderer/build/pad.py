"""Boxes a little larger than their triangles, which the KD-tree is built over."""

from __future__ import annotations

import numpy as np

from renderer.build.tree import Floats

PAD = 2.0**-17
"""Of the largest side of the box around all."""

PAD_PLACE = 2.0**-22
"""Of the largest |coordinate|: two float32 steps there."""


def pad_of(boxes: Floats) -> float:
    """How far `padded` moves every side of `boxes` (m, 2, 3) float32, at least."""
    exact = boxes.astype(np.float64)
    side = float((exact[:, 1].max(axis=0) - exact[:, 0].min(axis=0)).max())
    return PAD * side + PAD_PLACE * float(np.abs(exact).max())


def padded(boxes: Floats) -> Floats:
    """`boxes` (m, 2, 3) float32, larger on every side by at least `pad_of` them.

    A hit's position is computed in float32 and can lie just outside of its triangle's bounds; with these it lies
    inside the cells that hold the triangle, for rays that start up to twice the largest side away from the scene
    (ARCHITECTURE.md, Why no traversal loses a hit). And a plane of the tree, which is a face of one of these boxes,
    never lies on that triangle's true bounds. Rounded outward: never less than asked.
    """
    # The last factor outweighs the rounding of the float64 sums; the least pad gives a point at 0 a cell with width.
    pad = max(pad_of(boxes) * (1.0 + 2.0**-20), float(np.finfo(np.float32).tiny))
    lower, upper = boxes[:, 0].astype(np.float64) - pad, boxes[:, 1].astype(np.float64) + pad
    return np.stack([_rounded(lower, -np.inf), _rounded(upper, np.inf)], axis=1)


def _rounded(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], towards: float) -> Floats:
    """float32 of `values`, never on the wrong side of them."""
    nearest = values.astype(np.float32)
    beyond = np.nextafter(nearest, np.float32(towards))
    short = nearest > values if towards < 0 else nearest < values
    return np.where(short, beyond, nearest)
