"""Triangles cut in two wherever both parts cost less than the whole: clipped, and put in where each costs least.

Spatial splits (Stich, Friedrich and Dietrich 2009) choose planes before they know what will lie beside a part. Here a
leaf is taken out of a finished tree as for re-insertion (Bittner, Hapala and Havran 2013), and what comes back is the
whole or two parts, whatever costs less.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_rows
from renderer.build.kd_clip import CORNERS, Shapes, part_box
from renderer.build.loose import Loose, adopt, copy_node, fit_upward, sibling_of, union_area
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

SPARE = 3
"""Rows behind the nodes for boxes that are looked at: the whole, and its parts on either side of a plane."""


def parted(tree: Loose, refs: References, shapes: Shapes, costs: SahCosts) -> tuple[Loose, References]:
    """The tree with its large leaves of one reference cut where that costs less, and all references.

    A part's box holds whatever of the leaf's box is within the shapes' margin of the triangle, on its side of the
    plane.
    """
    area = half_areas(tree.box[:, 3:].astype(np.float64) - tree.box[:, :3])
    leaves = np.flatnonzero((tree.size == 1) & (tree.parent > 0) & (area > LARGE * area[0]))
    slots = tree.child[leaves[np.argsort(-area[leaves], kind="stable")]]
    nodes, references = len(tree.child) + 2 * len(slots), len(refs.triangle) + len(slots)
    box, child = resized_rows(tree.box, nodes + SPARE), resized(tree.child, nodes)
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
    home, whole = _homes(child, size, made, len(held.triangle)), len(child)
    stack, limits = np.empty(256, np.int32), np.empty(256, np.float64)
    work, least = np.empty((2, CORNERS, 3), np.float64), LEAST_GAIN * row_area(box, 0)
    for slot in slots:
        node, triangle = home[slot], held.triangle[slot]
        if parent[node] <= 0:
            continue
        for k in range(6):
            box[whole, k] = box[node, k]
        room, won = _take_out(box, child, size, parent, home, node)
        limit = won + weight * row_area(box, whole) - least
        axis, plane = _best_cut(box, child, size, shapes, weight, triangle, whole, limit, stack, limits, work)
        if axis >= 0:
            _cut(box, shapes, triangle, whole, axis, plane, work)
            leaves = weight * (row_area(box, whole + 1) + row_area(box, whole + 2))
            to, cost = _best_place(box, child, size, whole + 1, np.inf, stack, limits)
            _put_in(box, child, size, parent, home, whole + 1, slot, to, room)
            to, cost = _best_place(box, child, size, whole + 2, limit - leaves - cost, stack, limits)
            if to >= 0:
                _put_in(box, child, size, parent, home, whole + 2, filled, to, made)
                held.triangle[filled] = triangle
                for k in range(6):
                    held.box[slot, k], held.box[filled, k] = box[whole + 1, k], box[whole + 2, k]
                made, filled = made + 2, filled + 1
                continue
            room, won = _take_out(box, child, size, parent, home, home[slot])
        to, _ = _best_place(box, child, size, whole, np.inf, stack, limits)
        _put_in(box, child, size, parent, home, whole, slot, to, room)
    return made, filled


@jit
def _homes(child: Ints, size: Ints, made: int, slots: int) -> Ints:
    """The leaf that begins at each slot."""
    home = np.zeros(slots, np.int32)
    for node in range(made):
        if size[node] > 0:
            home[child[node]] = node
    return home


@jit
def _best_cut(
    box: Floats,
    child: Ints,
    size: Ints,
    shapes: Shapes,
    weight: float,
    triangle: int,
    whole: int,
    limit: float,
    stack: Ints,
    limits: Doubles,
    work: Doubles,
) -> tuple[int, np.float32]:
    """The axis and plane whose parts cost least together, each put in by itself; -1 where none is below the limit."""
    best, axis, plane = limit, -1, np.float32(0.0)
    for k in range(3):
        low, high = box[whole, k], box[whole, k + 3]
        if high - low <= 4.0 * shapes.margin:
            continue
        for i in range(PLANES):
            at = np.float32(low + (high - low) * np.float32(i + 1) / np.float32(PLANES + 1))
            if not _cut(box, shapes, triangle, whole, k, at, work):
                continue
            right = row_area(box, whole + 2)
            leaves = weight * (row_area(box, whole + 1) + right)
            to, cost = _best_place(box, child, size, whole + 1, best - leaves - right, stack, limits)
            if to < 0:
                continue
            to, more = _best_place(box, child, size, whole + 2, best - leaves - cost, stack, limits)
            if to >= 0:
                best, axis, plane = leaves + cost + more, k, at
    return axis, plane


@jit
def _cut(box: Floats, shapes: Shapes, triangle: int, whole: int, axis: int, plane: np.float32, work: Doubles) -> bool:
    """Puts the parts' boxes into the two rows behind that of the whole; whether there are two."""
    for side in range(2):
        part = whole + 1 + side
        for k in range(6):
            box[part, k] = box[whole, k]
        box[part, axis + 3 * (1 - side)] = plane
        if not part_box(shapes, triangle, box[part, :3], box[part, 3:], work, box[part]):
            return False
    return True


@jit
def _best_place(
    box: Floats, child: Ints, size: Ints, row: int, limit: float, stack: Ints, limits: Doubles
) -> tuple[int, float]:
    """The node that the box in a row is best put beside, and the surface that adds to inner nodes; -1 where that is
    not below the limit. From the root down, nearer children first."""
    own, best, to = row_area(box, row), limit, -1
    stack[0], limits[0], top = 0, 0.0, 1
    while top > 0:
        top -= 1
        node, grown = stack[top], limits[top]
        if grown + own >= best:
            continue
        around = union_area(box, node, row)
        if grown + around < best:
            best, to = grown + around, node
        below = grown + around - row_area(box, node)
        if size[node] > 0 or below + own >= best or top + 2 > len(stack):
            continue
        left = child[node]
        more_left = union_area(box, left, row) - row_area(box, left)
        more_right = union_area(box, left + 1, row) - row_area(box, left + 1)
        nearer = left + int(more_right < more_left)
        stack[top], limits[top] = 2 * left + 1 - nearer, below
        stack[top + 1], limits[top + 1] = nearer, below
        top += 2
    return to, best


@jit
def _take_out(box: Floats, child: Ints, size: Ints, parent: Ints, home: Ints, node: int) -> tuple[int, float]:
    """Takes a leaf from beside its sibling; returns the pair of places that is free, and the inner nodes' area won."""
    up, side = parent[node], sibling_of(child, parent, node)
    room, above = min(node, side), parent[up]
    won = row_area(box, up) + _area_upward(box, parent, above)
    copy_node(box, child, size, side, up)
    _tell(child, size, parent, home, up)
    fit_upward(box, child, parent, above)
    return room, won - _area_upward(box, parent, above)


@jit
def _area_upward(box: Floats, parent: Ints, start: int) -> float:
    total, node = 0.0, start
    while node >= 0:
        total += row_area(box, node)
        node = parent[node]
    return total


@jit
def _put_in(
    box: Floats, child: Ints, size: Ints, parent: Ints, home: Ints, row: int, slot: int, beside: int, room: int
) -> None:
    """Makes a leaf of the box in a row beside a node, in a free pair of places."""
    copy_node(box, child, size, beside, room)
    _tell(child, size, parent, home, room)
    for k in range(6):
        box[room + 1, k] = box[row, k]
    child[room + 1], size[room + 1], home[slot] = slot, 1, room + 1
    child[beside], size[beside] = room, 0
    parent[room], parent[room + 1] = beside, beside
    fit_upward(box, child, parent, beside)


@jit
def _tell(child: Ints, size: Ints, parent: Ints, home: Ints, node: int) -> None:
    """Tells who is below a node, or that it is a leaf's home."""
    adopt(child, size, parent, node)
    if size[node] > 0:
        home[child[node]] = node
