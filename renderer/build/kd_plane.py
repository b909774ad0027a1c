"""Which plane cuts a KD cell: the sweep over sorted events (Wald and Havran 2006, section 4.1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import KD_LEAF, Floats
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

END, PLANAR, START = 0, 1, 2
"""Kinds of event in the order that they take at one position; an event's code is triangle << 2 | kind."""

EMPTY_BONUS = 0.8
"""What a plane's cost is multiplied by where one side of it is empty (Wald and Havran 2006, section 3.2)."""


@jit
def best_plane(
    pos: Floats,
    code: Words,
    spans: npt.NDArray[np.int64],
    size: int,
    lower: Floats,
    upper: Floats,
    traversal: float,
    intersection: float,
) -> tuple[int, np.float32, bool]:
    """(axis, plane, whether triangles that lie in the plane go left) of least cost, or KD_LEAF if none is worth it.

    `pos`, `code` hold the events of axis a in [spans[a, 0], spans[a, 1]); `size` triangles are in the cell from
    `lower` to `upper`, (3,) each. Planes on the cell's faces are never taken.
    """
    best, axis, plane, planar_left = intersection * size, KD_LEAF, np.float32(0), True
    for candidate in range(3):
        cost, where, left = _sweep(
            pos[candidate, spans[candidate, 0] : spans[candidate, 1]],
            code[candidate, spans[candidate, 0] : spans[candidate, 1]],
            size,
            candidate,
            lower,
            upper,
            traversal,
            intersection,
            best,
        )
        if cost < best:
            best, axis, plane, planar_left = cost, candidate, where, left
    return axis, plane, planar_left


@jit
def _sweep(
    pos: Floats,
    code: Words,
    size: int,
    axis: int,
    lower: Floats,
    upper: Floats,
    traversal: float,
    intersection: float,
    best: float,
) -> tuple[float, np.float32, bool]:
    """The least cost below `best` among one axis's planes.

    Each event is priced where the counts are exact for its kind: an end after it is taken off the right, a start
    before it joins the left, planars on both sides of themselves. Other events at the same position only ever see
    counts that are too high, or a mix of planars that costs no less than all of them on one side.
    """
    low, high = np.float64(lower[axis]), np.float64(upper[axis])
    side = np.float64(upper[(axis + 1) % 3]) - np.float64(lower[(axis + 1) % 3])
    other = np.float64(upper[(axis + 2) % 3]) - np.float64(lower[(axis + 2) % 3])
    cap, rim = side * other, side + other
    area = cap + (high - low) * rim
    plane, planar_left = np.float32(0), True
    if area <= 0.0 or high <= low:
        return best, plane, planar_left
    scale = intersection / area
    left, right = size - _entering(code), size
    for i in range(len(pos)):
        at, kind = np.float64(pos[i]), code[i] & np.uint32(3)
        right -= kind == END
        if low < at < high:
            price = price_of(left, right, cap + (at - low) * rim, cap + (high - at) * rim, scale, traversal)
            if price < best:
                best, plane, planar_left = price, pos[i], kind == START
        left += kind != END
        if kind == PLANAR:
            right -= 1
            if low < at < high:
                price = price_of(left, right, cap + (at - low) * rim, cap + (high - at) * rim, scale, traversal)
                if price < best:
                    best, plane, planar_left = price, pos[i], True
    return best, plane, planar_left


@jit
def price_of(left: int, right: int, left_area: float, right_area: float, scale: float, traversal: float) -> float:
    """A plane's cost with so many triangles on each side; `scale` is the cost of testing one over the cell's area."""
    price = traversal + scale * (left * left_area + right * right_area)
    return price * EMPTY_BONUS if left == 0 or right == 0 else price


@jit
def _entering(code: Words) -> int:
    """How many triangles begin inside the list, as starts or planars; the cell's others lie across its lower face."""
    entering = 0
    for i in range(len(code)):
        entering += (code[i] & np.uint32(3)) != END
    return entering
