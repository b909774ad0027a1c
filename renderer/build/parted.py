"""Triangles cut in two wherever both parts cost less than the whole: clipped, and put in where each costs least.

Spatial splits (Stich, Friedrich and Dietrich 2009) choose planes before they know what will lie beside a part. Here a
leaf is taken out of a finished tree as for re-insertion (Bittner, Hapala and Havran 2013), and what comes back is the
whole or two parts, whatever costs less.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_rows
from renderer.build.insertion import ROOM, best_place, put_in, take_out
from renderer.build.kd_clip import CORNERS, Shapes, part_box
from renderer.build.loose import Loose
from renderer.build.sbvh import References
from renderer.build.spatial_split import row_area
from renderer.build.tree import Floats, Ints, SahCosts, half_areas
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

LARGE = 5e-5
"""Of the root's area: smaller leaves are left whole."""

PLANES = 7
"""Along each axis, evenly spaced through the leaf's box."""

LEAST_GAIN = 1e-9
"""Of the root's area; rounding is less."""


def parted(tree: Loose, refs: References, shapes: Shapes, costs: SahCosts) -> tuple[Loose, References]:
    """The tree with its large leaves of one reference cut where that costs less, and all references.

    A part's box holds whatever of the leaf's box is within the shapes' margin of the triangle, on its side of the
    plane.
    """
    area = half_areas(tree.box[:, 3:].astype(np.float64) - tree.box[:, :3])
    leaves = np.flatnonzero((tree.size == 1) & (tree.parent > 0) & (area > LARGE * area[0]))
    slots = tree.child[leaves[np.argsort(-area[leaves], kind="stable")]]
    nodes, references = len(tree.child) + 2 * len(slots), len(refs.triangle) + len(slots)
    box, child = resized_rows(tree.box, nodes), resized(tree.child, nodes)
    size, parent = resized(tree.size, nodes), resized(tree.parent, nodes)
    held = References(resized_rows(refs.box, references), resized(refs.triangle, references))
    # Of a leaf's area, an inner node's counts 1.
    weight = costs.intersection / max(costs.traversal, 1e-3 * costs.intersection, 1e-300)
    made, filled = _part_all(box, child, size, parent, held, shapes, weight, slots, len(tree.child), len(refs.triangle))
    after = Loose(resized_rows(box, made), resized(child, made), resized(size, made), resized(parent, made))
    return after, References(resized_rows(held.box, filled), resized(held.triangle, filled))


@jit
def _part_all(
    box: Floats,
    child: Ints,
    size: Ints,
    parent: Ints,
    held: References,
    shapes: Shapes,
    weight: float,
    slots: Ints,
    made: int,
    filled: int,
) -> tuple[int, int]:
    """Takes every leaf out in turn and puts it or its parts in; returns how many nodes and references there are."""
    home = np.zeros(len(held.triangle), np.int32)
    for node in range(made):
        _note(child, size, home, node)
    parts = np.empty((3, 6), np.float32)
    stack, induced = np.empty(ROOM, np.int32), np.empty(ROOM, np.float64)
    work, least = np.empty((2, CORNERS, 3), np.float64), LEAST_GAIN * row_area(box, 0)
    for slot in slots:
        node, triangle = home[slot], held.triangle[slot]
        up = parent[node]
        if up <= 0:
            continue
        for k in range(6):
            parts[0, k] = box[node, k]
        before = _area_upward(box, parent, up)
        pair = take_out(box, child, size, parent, node)
        _note(child, size, home, up)
        limit = before - _area_upward(box, parent, parent[up]) + weight * row_area(parts, 0) - least
        axis, plane = _best_cut(box, child, size, shapes, weight, triangle, parts, limit, stack, induced, work)
        if axis >= 0:
            _cut(parts, shapes, triangle, axis, plane, work)
            leaves = weight * (row_area(parts, 1) + row_area(parts, 2))
            to, cost = best_place(box, child, size, parts[1:2], np.inf, stack, induced)
            _put_leaf(box, child, size, parent, home, pair, parts[1:2], slot, to)
            to, cost = best_place(box, child, size, parts[2:], limit - leaves - cost, stack, induced)
            if to >= 0:
                _put_leaf(box, child, size, parent, home, made, parts[2:], filled, to)
                held.triangle[filled] = triangle
                for k in range(6):
                    held.box[slot, k], held.box[filled, k] = parts[1, k], parts[2, k]
                made, filled = made + 2, filled + 1
                continue
            up = parent[home[slot]]
            pair = take_out(box, child, size, parent, home[slot])
            _note(child, size, home, up)
        to, _ = best_place(box, child, size, parts[:1], np.inf, stack, induced)
        _put_leaf(box, child, size, parent, home, pair, parts[:1], slot, to)
    return made, filled


@jit
def _put_leaf(
    box: Floats, child: Ints, size: Ints, parent: Ints, home: Ints, pair: int, own: Floats, slot: int, there: int
) -> None:
    """Puts a leaf of one slot beside `there`, into the free pair, and notes which leaves are there now."""
    put_in(box, child, size, parent, pair + 1, pair, own, slot, 1, there)
    _note(child, size, home, pair)
    _note(child, size, home, pair + 1)


@jit
def _best_cut(
    box: Floats,
    child: Ints,
    size: Ints,
    shapes: Shapes,
    weight: float,
    triangle: int,
    parts: Floats,
    limit: float,
    stack: Ints,
    induced: Doubles,
    work: Doubles,
) -> tuple[int, np.float32]:
    """The axis and plane whose parts cost least together, each put in by itself; -1 where none is below the limit."""
    best, axis, plane = limit, -1, np.float32(0.0)
    for k in range(3):
        low, high = parts[0, k], parts[0, k + 3]
        if high - low <= 4.0 * shapes.margin:
            continue
        for i in range(PLANES):
            at = np.float32(low + (high - low) * np.float32(i + 1) / np.float32(PLANES + 1))
            if not _cut(parts, shapes, triangle, k, at, work):
                continue
            right = row_area(parts, 2)
            leaves = weight * (row_area(parts, 1) + right)
            to, cost = best_place(box, child, size, parts[1:2], best - leaves - right, stack, induced)
            if to < 0:
                continue
            to, more = best_place(box, child, size, parts[2:], best - leaves - cost, stack, induced)
            if to >= 0:
                best, axis, plane = leaves + cost + more, k, at
    return axis, plane


@jit
def _cut(parts: Floats, shapes: Shapes, triangle: int, axis: int, plane: np.float32, work: Doubles) -> bool:
    """Puts the boxes of two parts behind that of the whole, (3, 6); whether there are two."""
    for side in range(2):
        part = parts[1 + side]
        for k in range(6):
            part[k] = parts[0, k]
        part[axis + 3 * (1 - side)] = plane
        if not part_box(shapes, triangle, part[:3], part[3:], work, part):
            return False
    return True


@jit
def _area_upward(box: Floats, parent: Ints, start: int) -> float:
    total, node = 0.0, start
    while node >= 0:
        total += row_area(box, node)
        node = parent[node]
    return total


@jit
def _note(child: Ints, size: Ints, home: Ints, node: int) -> None:
    """Notes where a leaf is now, if it is one."""
    if size[node] > 0:
        home[child[node]] = node
