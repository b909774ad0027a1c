"""Subtrees of a KD-tree over few triangles: planes are priced by counting, without event lists.

The planes, their prices and so the trees are those of the sweep over events (`kd_plane`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.build.grow import resized
from renderer.build.kd_nodes import Nodes, halve, nodes_resized
from renderer.build.kd_plane import EMPTY_BONUS
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Floats, Ints
from renderer.jit import jit

FEW = 24
"""Cells of at most so many triangles are finished here."""


class Cells(NamedTuple):
    """Room for the cells that wait, one a level: their triangles, `held` of them, and what these have in the cell.

    `box` (levels, 2, 3), `low`, `high` (levels, 3, FEW) float32; `triangle` (levels, FEW), `held`, `node`, `depth`
    (levels,) int32.
    """

    box: Floats
    low: Floats
    high: Floats
    triangle: Ints
    held: Ints
    node: Ints
    depth: Ints


@jit
def room_for_cells() -> Cells:
    """As many as can wait."""
    levels = MAX_DEPTH + 2
    boxes, numbers = (levels, 3, FEW), (4, levels)
    made = np.empty(numbers, np.int32)
    return Cells(
        np.empty((levels, 2, 3), np.float32),
        np.empty(boxes, np.float32),
        np.empty(boxes, np.float32),
        np.empty((levels, FEW), np.int32),
        made[0],
        made[1],
        made[2],
    )


@jit
def finish(
    boxes: Floats,
    triangles: Ints,
    cell: Floats,
    root: int,
    level: int,
    nodes: Nodes,
    made: int,
    refs: Ints,
    filled: int,
    cells: Cells,
    max_depth: int,
    traversal: float,
    intersection: float,
) -> tuple[Nodes, int, Ints, int]:
    """Splits the `cell` (2, 3) of the node `root`, with its `triangles`, until all below are leaves, left before right.

    `boxes` (m, 2, 3) are the whole triangles'. Returns the nodes, how many are made, the leaves' triangles, how many.
    """
    box, low, high, triangle, held, node, depth = cells
    split, axis, child, size = nodes
    for i in range(len(triangles)):
        triangle[0, i] = triangles[i]
        for k in range(3):
            low[0, k, i] = max(boxes[triangles[i], 0, k], cell[0, k])
            high[0, k, i] = min(boxes[triangles[i], 1, k], cell[1, k])
    for k in range(3):
        box[0, 0, k], box[0, 1, k] = cell[0, k], cell[1, k]
    held[0], node[0], depth[0], top = len(triangles), root, level, 1
    while top > 0:
        top -= 1
        here, at, deep = held[top], node[top], depth[top]
        chosen, plane, flat_left = KD_LEAF, np.float32(0), True
        if here > 0 and deep < max_depth:
            chosen, plane, flat_left = best_plane_counted(
                low[top], high[top], here, box[top, 0], box[top, 1], traversal, intersection
            )
        axis[at], split[at] = chosen, plane
        if chosen == KD_LEAF:
            child[at], size[at] = filled, here
            if filled + here > len(refs):
                refs = resized(refs, 2 * (filled + here))
            for i in range(here):
                refs[filled + i] = triangle[top, i]
            filled += here
            continue
        if made + 2 > len(axis):
            nodes = nodes_resized(nodes, 2 * (made + 2))
            split, axis, child, size = nodes
        child[at], size[at] = made, 0
        halve(box[top], box[top], box[top + 1], chosen, plane)
        held[top], held[top + 1] = _divide(low, high, triangle, top, here, chosen, plane, flat_left)
        node[top], node[top + 1], depth[top], depth[top + 1] = made + 1, made, deep + 1, deep + 1
        top += 2
        made += 2
    return nodes, made, refs, filled


@jit
def best_plane_counted(
    low: Floats, high: Floats, held: int, lower: Floats, upper: Floats, traversal: float, intersection: float
) -> tuple[int, np.float32, bool]:
    """As `kd_plane.best_plane`, from what `held` triangles have in the cell, `low` and `high` (3, FEW)."""
    best, axis, plane, flat_left = intersection * held, KD_LEAF, np.float32(0), True
    for k in range(3):
        begin, end = np.float64(lower[k]), np.float64(upper[k])
        side = np.float64(upper[(k + 1) % 3]) - np.float64(lower[(k + 1) % 3])
        other = np.float64(upper[(k + 2) % 3]) - np.float64(lower[(k + 2) % 3])
        cap, rim = side * other, side + other
        area = cap + (end - begin) * rim
        if area <= 0.0 or end <= begin:
            continue
        scale = intersection / area
        for j in range(2 * held):
            face = low[k, j] if j < held else high[k, j - held]
            if not lower[k] < face < upper[k]:
                continue
            left, right, across = 0, 0, 0
            for i in range(held):
                starts, ends = int(low[k, i] < face), int(high[k, i] > face)
                left += starts
                right += ends
                across += starts & ends
            flat = held - left - right + across
            place = np.float64(face)
            left_area, right_area = cap + (place - begin) * rim, cap + (end - place) * rim
            for leftward in range(2 if flat > 0 else 1):
                on_left = left + flat * leftward
                on_right = right + flat * (1 - leftward)
                price = traversal + scale * (on_left * left_area + on_right * right_area)
                if on_left == 0 or on_right == 0:
                    price *= EMPTY_BONUS
                if price < best or (price == best and axis == k and face < plane):
                    best, axis, plane, flat_left = price, k, face, leftward == 1
    return axis, plane, flat_left


@jit
def _divide(
    low: Floats, high: Floats, triangle: Ints, top: int, held: int, axis: int, plane: np.float32, flat_left: bool
) -> tuple[int, int]:
    """Puts the right child's triangles in their cell's place and the left's above it; returns how many each has."""
    left, right = 0, 0
    for i in range(held):
        begin, end, one = low[top, axis, i], high[top, axis, i], triangle[top, i]
        flat = begin == plane and end == plane
        to_left, to_right = begin < plane or (flat and flat_left), end > plane or (flat and not flat_left)
        for k in range(3):
            from_low, from_high = low[top, k, i], high[top, k, i]
            low[top + 1, k, left], high[top + 1, k, left] = from_low, from_high
            low[top, k, right], high[top, k, right] = from_low, from_high
        high[top + 1, axis, left], low[top, axis, right] = min(end, plane), max(begin, plane)
        triangle[top + 1, left], triangle[top, right] = one, one
        left += int(to_left)
        right += int(to_right)
    return right, left
