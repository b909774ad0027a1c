"""How the BVH build lays out the boxes that it reads: near in space is near in memory, scaled to unit size."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.radix import stable_order
from renderer.build.tree import Floats
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

LEAST_REACH = np.float32(1e-30)
"""Of boxes scaled to unit size: the number of bins over less may overflow."""


def spatial_order(boxes: Floats) -> Words:
    """The triangles along a Morton curve through their centroids, so that the lists' gathers stay in cache."""
    centre = boxes[:, 0] * np.float32(0.5) + boxes[:, 1] * np.float32(0.5)
    lowest = centre.min(axis=0)
    reach = np.maximum(centre.max(axis=0) - lowest, np.float32(np.finfo(np.float32).tiny))
    return stable_order(_morton_codes(centre, lowest, reach))


@jit
def _morton_codes(centre: Floats, lowest: Floats, reach: Floats) -> Words:
    codes = np.zeros(len(centre), np.uint32)
    for i in range(len(centre)):
        for axis in range(3):
            cell = np.uint32((centre[i, axis] - lowest[axis]) / reach[axis] * np.float32(1023))
            cell = (cell | cell << np.uint32(16)) & np.uint32(0x030000FF)
            cell = (cell | cell << np.uint32(8)) & np.uint32(0x0300F00F)
            cell = (cell | cell << np.uint32(4)) & np.uint32(0x030C30C3)
            cell = (cell | cell << np.uint32(2)) & np.uint32(0x09249249)
            codes[i] |= cell << np.uint32(axis)
    return codes


def normalised(boxes: Floats, order: Words) -> Floats:
    """(m, 6) copies in `order`, scaled by a power of two so that no area over- or underflows."""
    _, exponent = np.frexp(np.abs(boxes).max())
    gathered = np.empty((len(order), 6), np.float32)
    _gather_scaled(boxes.reshape(-1, 6), order, np.ldexp(1.0, -int(exponent)), gathered)
    return gathered


@jit
def _gather_scaled(boxes: Floats, order: Words, scale: float, gathered: Floats) -> None:
    for i in range(len(order)):
        for side in range(6):
            gathered[i, side] = np.float32(boxes[order[i], side] * scale)
