"""What a KD cell holds of a triangle: the box of the part inside, for splits as tight as they can be.

Wald and Havran 2006, section 4.3 ("perfect splits"), with Sutherland and Hodgman's clipping (1974). The cell is grown
by a margin before the triangle is clipped, and the part's box by as much after: a point of the cell within the margin
of the triangle is never left out (ARCHITECTURE.md, Why no traversal loses a hit).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.pad import extent
from renderer.build.tree import Floats
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

MARGIN = 2.0**-14
"""Of the largest side of the box around all."""

MARGIN_PLACE = 2.0**-21
"""Of the largest |coordinate|: more than the margin's own rounding."""

CORNERS = 9
"""The most corners of a triangle clipped by six planes."""


class Shapes(NamedTuple):
    """The triangles (m, 3, 3) float32, their padded boxes (m, 2, 3) float32, and the margin.

    Without triangles nothing is clipped, and a triangle's part is what its box has in the cell.
    """

    triangles: Floats
    boxes: Floats
    margin: float


def shapes_of(triangles: Floats, boxes: Floats) -> Shapes:
    """What is clipped to: `triangles` (m, 3, 3) whose padded `boxes` are (m, 2, 3)."""
    side, place = extent(boxes)
    return Shapes(triangles, boxes, MARGIN * side + MARGIN_PLACE * place)


def unclipped(boxes: Floats) -> Shapes:
    """No shapes but the boxes themselves."""
    return Shapes(np.empty((0, 3, 3), np.float32), boxes, 0.0)


@jit
def clipped_box(shapes: Shapes, one: int, lower: Floats, upper: Floats, work: Doubles, box: Floats) -> bool:
    """Whether a triangle's part in the cell from `lower` to `upper` is there, and its box (6,), cut by the cell.

    `work` (2, CORNERS, 3) is scratch.
    """
    there = part_box(shapes, one, lower, upper, work, box)
    return there and box[0] < box[3] and box[1] < box[4] and box[2] < box[5]


@jit
def part_box(shapes: Shapes, one: int, lower: Floats, upper: Floats, work: Doubles, box: Floats) -> bool:
    """The same where a flat part counts too; `box` may be what `lower` and `upper` are views of."""
    corners, at = 3, 0
    for i in range(3):
        for k in range(3):
            work[0, i, k] = shapes.triangles[one, i, k]
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = lower[axis] - shapes.margin if sign > 0.0 else -(upper[axis] + shapes.margin)
            least = np.inf
            for i in range(corners):
                least = min(least, sign * work[at, i, axis])
            if least >= face:
                continue
            corners = _cut(work, at, corners, axis, sign, face)
            at = 1 - at
            if corners == 0:
                return False
    for k in range(3):
        low, high = np.inf, -np.inf
        for i in range(corners):
            low, high = min(low, work[at, i, k]), max(high, work[at, i, k])
        box[k] = max(max(np.float32(low - shapes.margin), shapes.boxes[one, 0, k]), lower[k])
        box[k + 3] = min(min(np.float32(high + shapes.margin), shapes.boxes[one, 1, k]), upper[k])
    return True


@jit
def _cut(work: Doubles, at: int, corners: int, axis: int, sign: float, face: float) -> int:
    """Keeps what of the polygon work[at] lies at `face` or beyond it, as work[1 - at]; returns how many corners."""
    made, before = 0, corners - 1
    was = sign * work[at, before, axis] - face
    for i in range(corners):
        now = sign * work[at, i, axis] - face
        if (now >= 0.0) != (was >= 0.0) and made < CORNERS:
            share = was / (was - now)
            for k in range(3):
                work[1 - at, made, k] = work[at, before, k] + share * (work[at, i, k] - work[at, before, k])
            work[1 - at, made, axis] = sign * face
            made += 1
        if now >= 0.0 and made < CORNERS:
            for k in range(3):
                work[1 - at, made, k] = work[at, i, k]
            made += 1
        before, was = i, now
    return made
