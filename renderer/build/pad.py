"""Boxes a little larger than their triangles, which the KD-tree is built over."""

from __future__ import annotations

import numpy as np

from renderer.build.tree import Floats

PAD = 2.0**-19


def padded(boxes: Floats) -> Floats:
    """`boxes` (m, 2, 3) float32, larger on every side by at least PAD times the largest |coordinate| of all.

    A hit's position is computed in float32 and can lie just outside of its triangle's bounds; with these it lies
    inside the cells that hold the triangle, for eyes up to four scene radii away. And a plane of the tree, which
    is a face of one of these boxes, never lies on that triangle's true bounds. Rounded outward: never less than
    asked.
    """
    # The last factor outweighs the rounding of the float64 sums; the least pad gives a point at 0 a cell with width.
    pad = max(PAD * float(np.abs(boxes).max()) * (1.0 + 2.0**-33), float(np.finfo(np.float32).tiny))
    lower, upper = boxes[:, 0].astype(np.float64) - pad, boxes[:, 1].astype(np.float64) + pad
    return np.stack([_rounded(lower, -np.inf), _rounded(upper, np.inf)], axis=1)


def _rounded(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], towards: float) -> Floats:
    """float32 of `values`, never on the wrong side of them."""
    nearest = values.astype(np.float32)
    beyond = np.nextafter(nearest, np.float32(towards))
    short = nearest > values if towards < 0 else nearest < values
    return np.where(short, beyond, nearest)
