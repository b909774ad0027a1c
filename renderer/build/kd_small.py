"""Subtrees of a KD-tree over few triangles, whose faces lie in order as bytes that name them.

The planes, their prices and so the trees are those of the sweep over events (`kd_plane`). A face strictly inside a cell
is a triangle's own, never one that was cut, so no cell keeps what it has of its triangles' boxes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized
from renderer.build.kd_events import TRIANGLES, Lists, Spans
from renderer.build.kd_nodes import Nodes, halve, nodes_resized
from renderer.build.kd_plane import END, START, price_of
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Bytes, Floats, Ints
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

FEW = 48
"""Cells of at most so many triangles are finished here."""


class Cells(NamedTuple):
    """Room for the cells that wait, one a level, and for the triangles of the first.

    `triangle` (FEW,) int32 with `low`, `high` (3, FEW) float32, their boxes; all else names them by their place there.
    Of each cell `box` (levels, 2, 3); `member` (levels, FEW) uint8, its triangles, `held` of them; `starts`, `ends`
    (levels, 3, FEW) uint8, for each axis those whose lower and whose upper face lies strictly inside, in the faces'
    order, `inside` (levels, 3, 2) int32 of them; `node`, `depth` (levels,) int32. `goes` (FEW,) uint8 is scratch.
    """

    triangle: Ints
    low: Floats
    high: Floats
    box: Floats
    member: Bytes
    held: Ints
    starts: Bytes
    ends: Bytes
    inside: Ints
    node: Ints
    depth: Ints
    goes: Bytes


@jit
def room_for_cells() -> Cells:
    """As many as can wait."""
    levels = MAX_DEPTH + 2
    made = np.empty((3, levels), np.int32)
    return Cells(
        np.empty(FEW, np.int32),
        np.empty((3, FEW), np.float32),
        np.empty((3, FEW), np.float32),
        np.empty((levels, 2, 3), np.float32),
        np.empty((levels, FEW), np.uint8),
        made[0],
        np.empty((levels, 3, FEW), np.uint8),
        np.empty((levels, 3, FEW), np.uint8),
        np.empty((levels, 3, 2), np.int32),
        made[1],
        made[2],
        np.empty(FEW, np.uint8),
    )


@jit
def take(cells: Cells, lists: Lists, span: Spans, ids: Ints, boxes: Floats, cell: Floats, rank: Words) -> None:
    """Makes the `cell` (2, 3) with the lists at `span` the first; `ids` names its triangles, whose boxes are `boxes`.

    `rank` is scratch, an entry for each of the lists' triangles.
    """
    begin, end = span[TRIANGLES]
    cells.held[0] = end - begin
    for i in range(end - begin):
        one = lists.triangle[begin + i]
        rank[one] = i
        cells.triangle[i], cells.member[0, i] = ids[one], i
        for k in range(3):
            cells.low[k, i], cells.high[k, i] = boxes[ids[one], 0, k], boxes[ids[one], 1, k]
    for k in range(3):
        cells.box[0, 0, k], cells.box[0, 1, k] = cell[0, k], cell[1, k]
        starts, ends = 0, 0
        for i in range(span[k, 0], span[k, 1]):
            if cell[0, k] < lists.pos[k, i] < cell[1, k]:
                kind, one = lists.code[k, i] & np.uint32(3), rank[lists.code[k, i] >> np.uint32(2)]
                if kind != START:
                    cells.ends[0, k, ends] = one
                    ends += 1
                if kind != END:
                    cells.starts[0, k, starts] = one
                    starts += 1
        cells.inside[0, k, 0], cells.inside[0, k, 1] = starts, ends


@jit
def finish(
    cells: Cells,
    root: int,
    level: int,
    nodes: Nodes,
    made: int,
    refs: Ints,
    filled: int,
    max_depth: int,
    traversal: float,
    intersection: float,
) -> tuple[Nodes, int, Ints, int]:
    """Splits the cell that was taken, of the node `root`, until all below are leaves, left before right.

    Returns the nodes, how many are made, the leaves' triangles, how many.
    """
    box, held, node, depth = cells.box, cells.held, cells.node, cells.depth
    split, axis, child, size = nodes
    node[0], depth[0], top = root, level, 1
    while top > 0:
        top -= 1
        here, at, deep = held[top], node[top], depth[top]
        chosen, plane, flat_left = KD_LEAF, np.float32(0), True
        if here > 0 and deep < max_depth:
            chosen, plane, flat_left = best_plane_of_few(cells, top, traversal, intersection)
        axis[at], split[at] = chosen, plane
        if chosen == KD_LEAF:
            child[at], size[at] = filled, here
            if filled + here > len(refs):
                refs = resized(refs, 2 * (filled + here))
            for i in range(here):
                refs[filled + i] = cells.triangle[cells.member[top, i]]
            filled += here
            continue
        if made + 2 > len(axis):
            nodes = nodes_resized(nodes, 2 * (made + 2))
            split, axis, child, size = nodes
        child[at], size[at] = made, 0
        _divide(cells, top, chosen, plane, flat_left)
        halve(box[top], box[top], box[top + 1], chosen, plane)
        node[top], node[top + 1], depth[top], depth[top + 1] = made + 1, made, deep + 1, deep + 1
        top += 2
        made += 2
    return nodes, made, refs, filled


@jit
def best_plane_of_few(cells: Cells, top: int, traversal: float, intersection: float) -> tuple[int, np.float32, bool]:
    """As `kd_plane.best_plane`, of the cell at `top`."""
    held, low, high, starts, ends = cells.held[top], cells.low, cells.high, cells.starts, cells.ends
    best, axis, plane, flat_left = intersection * held, KD_LEAF, np.float32(0), True
    for k in range(3):
        lower, upper = cells.box[top, 0, k], cells.box[top, 1, k]
        begin, end = np.float64(lower), np.float64(upper)
        side = np.float64(cells.box[top, 1, (k + 1) % 3]) - np.float64(cells.box[top, 0, (k + 1) % 3])
        other = np.float64(cells.box[top, 1, (k + 2) % 3]) - np.float64(cells.box[top, 0, (k + 2) % 3])
        cap, rim = side * other, side + other
        area = cap + (end - begin) * rim
        if area <= 0.0 or end <= begin:
            continue
        scale = intersection / area
        left, right = 0, held  # those that begin before a face, and that end after it
        for i in range(held):
            one = cells.member[top, i]
            left += int(low[k, one] <= lower)
            right -= int(high[k, one] <= lower)
        i, j, all_starts, all_ends = 0, 0, cells.inside[top, k, 0], cells.inside[top, k, 1]
        while i < all_starts or j < all_ends:
            face = low[k, starts[top, k, i]] if i < all_starts else upper
            if j < all_ends:
                face = min(face, high[k, ends[top, k, j]])
            begun, flat = left, 0
            while i < all_starts and low[k, starts[top, k, i]] == face:
                flat += int(high[k, starts[top, k, i]] == face)
                left += 1
                i += 1
            while j < all_ends and high[k, ends[top, k, j]] == face:
                right -= 1
                j += 1
            place = np.float64(face)
            left_area, right_area = cap + (place - begin) * rim, cap + (end - place) * rim
            for leftward in range(2 if flat > 0 else 1):
                on_left = begun + flat * leftward
                on_right = right + flat * (1 - leftward)
                price = price_of(on_left, on_right, left_area, right_area, scale, traversal)
                if price < best:
                    best, axis, plane, flat_left = price, k, face, leftward == 1
    return axis, plane, flat_left


@jit
def _divide(cells: Cells, top: int, axis: int, plane: np.float32, flat_left: bool) -> None:
    """Puts the right child's triangles in their cell's place and the left's above it."""
    low, high, member, goes = cells.low[axis], cells.high[axis], cells.member, cells.goes
    left, right = 0, 0
    for i in range(cells.held[top]):
        one = member[top, i]
        flat = low[one] == plane and high[one] == plane
        to_left = low[one] < plane or (flat and flat_left)
        to_right = high[one] > plane or (flat and not flat_left)
        member[top + 1, left], member[top, right] = one, one
        goes[one] = int(to_left) | int(to_right) << 1
        left += int(to_left)
        right += int(to_right)
    cells.held[top + 1], cells.held[top] = left, right
    for k in range(3):
        for faces, of, which in ((cells.starts, cells.low, 0), (cells.ends, cells.high, 1)):
            left, right = 0, 0
            for i in range(cells.inside[top, k, which]):
                one = faces[top, k, i]
                to_left, to_right = goes[one] & np.uint8(1) != 0, goes[one] > 1
                if k == axis:
                    # Strictly inside the child: what the plane cuts ends on its face.
                    to_left, to_right = of[k, one] < plane, of[k, one] > plane
                faces[top + 1, k, left], faces[top, k, right] = one, one
                left += int(to_left)
                right += int(to_right)
            cells.inside[top + 1, k, which], cells.inside[top, k, which] = left, right
