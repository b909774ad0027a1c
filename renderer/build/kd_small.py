"""Subtrees of a KD-tree over few triangles: their events lie in order once, and each cell has its own as a word's bits.

The planes, their prices and so the trees are those of the sweep over lists of events (`kd_plane`, `kd_events`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.bits import NONE, ONE, below, lowest, ones
from renderer.build.grow import resized
from renderer.build.kd_events import TRIANGLES, Lists, Spans
from renderer.build.kd_nodes import Nodes, nodes_resized
from renderer.build.kd_plane import END, PLANAR, START, price_of
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Bytes, Floats, Ints
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
Sets = npt.NDArray[np.uint64]

FEW = 32
"""Cells of at most so many triangles are finished here: an axis has at most two events of each, and a word 64 bits."""

EVENTS = 2 * FEW


class Cells(NamedTuple):
    """Room for the cells that wait, one a level, and for the triangles and events of the first.

    `triangle` (FEW,) int32; all else names them by their place there. For each axis its `size` (3,) events in order:
    `pos` (3, EVENTS) float32, `kind` (3, EVENTS) uint8, and as sets of their places those that are no ends, `begin`
    (3,), and a triangle's, `own` (3, FEW). Triangles whose starts or planars, and whose ends or planars, lie before a
    place: `begun`, `ended` (3, EVENTS + 1). Of each waiting cell `box` (levels, 2, 3); as sets its `events` (levels, 3)
    and its triangles, `member` (levels,); `node`, `depth` (levels,) int32.
    """

    triangle: Ints
    size: Ints
    pos: Floats
    kind: Bytes
    begin: Sets
    own: Sets
    begun: Sets
    ended: Sets
    box: Floats
    events: Sets
    member: Sets
    node: Ints
    depth: Ints


@jit
def room_for_cells() -> Cells:
    """As many as can wait."""
    levels = MAX_DEPTH + 2
    return Cells(
        np.empty(FEW, np.int32),
        np.empty(3, np.int32),
        np.empty((3, EVENTS), np.float32),
        np.empty((3, EVENTS), np.uint8),
        np.empty(3, np.uint64),
        np.empty((3, FEW), np.uint64),
        np.empty((3, EVENTS + 1), np.uint64),
        np.empty((3, EVENTS + 1), np.uint64),
        np.empty((levels, 2, 3), np.float32),
        np.empty((levels, 3), np.uint64),
        np.empty(levels, np.uint64),
        np.empty(levels, np.int32),
        np.empty(levels, np.int32),
    )


@jit
def take(cells: Cells, lists: Lists, span: Spans, ids: Ints, cell: Floats, rank: Words) -> None:
    """Makes the `cell` (2, 3) with the lists at `span` the first; `ids` names its triangles in the scene.

    `rank` is scratch, an entry for each of the lists' triangles.
    """
    begin, end = span[TRIANGLES]
    cells.member[0] = below(end - begin)
    for i in range(end - begin):
        one = lists.triangle[begin + i]
        rank[one] = i
        cells.triangle[i] = ids[one]
        for k in range(3):
            cells.own[k, i] = NONE
    for k in range(3):
        cells.box[0, 0, k], cells.box[0, 1, k] = cell[0, k], cell[1, k]
        first, size = span[k, 0], span[k, 1] - span[k, 0]
        cells.size[k], cells.events[0, k], cells.begin[k] = size, below(size), NONE
        cells.begun[k, 0], cells.ended[k, 0] = NONE, NONE
        for i in range(size):
            code = lists.code[k, first + i]
            kind, one = code & np.uint32(3), np.int64(rank[code >> np.uint32(2)])
            cells.pos[k, i], cells.kind[k, i] = lists.pos[k, first + i], kind
            cells.own[k, one] |= ONE << np.uint64(i)
            begins, ends = np.uint64(kind != END), np.uint64(kind != START)
            cells.begin[k] |= begins << np.uint64(i)
            cells.begun[k, i + 1] = cells.begun[k, i] | begins << np.uint64(one)
            cells.ended[k, i + 1] = cells.ended[k, i] | ends << np.uint64(one)


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
    box, member, node, depth = cells.box, cells.member, cells.node, cells.depth
    split, axis, child, size = nodes
    node[0], depth[0], top = root, level, 1
    while top > 0:
        top -= 1
        here, at, deep = member[top], node[top], depth[top]
        held = ones(here)
        chosen, event, flat_left = KD_LEAF, 0, True
        if held > 0 and deep < max_depth:
            chosen, event, flat_left = _best_event(cells, top, held, traversal, intersection)
        axis[at] = chosen
        if chosen == KD_LEAF:
            split[at], child[at], size[at] = np.float32(0), filled, held
            if filled + held > len(refs):
                refs = resized(refs, 2 * (filled + held))
            while here != NONE:
                refs[filled] = cells.triangle[lowest(here)]
                here &= here - ONE
                filled += 1
            continue
        if made + 2 > len(axis):
            nodes = nodes_resized(nodes, 2 * (made + 2))
            split, axis, child, size = nodes
        plane = cells.pos[chosen, event]
        split[at], child[at], size[at] = plane, made, 0
        _divide(cells, top, chosen, event, flat_left)
        # As `halve`, to which slices would have to be given, whose references cost more than the cut.
        for k in range(3):
            box[top + 1, 0, k], box[top + 1, 1, k] = box[top, 0, k], box[top, 1, k]
        box[top, 0, chosen], box[top + 1, 1, chosen] = plane, plane
        node[top], node[top + 1], depth[top], depth[top + 1] = made + 1, made, deep + 1, deep + 1
        top += 2
        made += 2
    return nodes, made, refs, filled


@jit
def _best_event(cells: Cells, top: int, held: int, traversal: float, intersection: float) -> tuple[int, int, bool]:
    """As `kd_plane.best_plane`, of the cell at `top`; the plane is an event's, told by its place."""
    best, axis, event, flat_left = intersection * held, KD_LEAF, 0, True
    for k in range(3):
        waiting = cells.events[top, k]
        low, high = np.float64(cells.box[top, 0, k]), np.float64(cells.box[top, 1, k])
        side = np.float64(cells.box[top, 1, (k + 1) % 3]) - np.float64(cells.box[top, 0, (k + 1) % 3])
        other = np.float64(cells.box[top, 1, (k + 2) % 3]) - np.float64(cells.box[top, 0, (k + 2) % 3])
        cap, rim = side * other, side + other
        area = cap + (high - low) * rim
        if area <= 0.0 or high <= low:
            continue
        scale = intersection / area
        left, right = held - ones(waiting & cells.begin[k]), held
        while waiting != NONE:
            i = lowest(waiting)
            waiting &= waiting - ONE
            at, kind = np.float64(cells.pos[k, i]), cells.kind[k, i]
            inside = low < at < high
            right -= kind == END
            if inside:
                price = price_of(left, right, cap + (at - low) * rim, cap + (high - at) * rim, scale, traversal)
                if price < best:
                    best, axis, event, flat_left = price, k, i, kind == START
            left += kind != END
            if kind == PLANAR:
                right -= 1
                if inside:
                    price = price_of(left, right, cap + (at - low) * rim, cap + (high - at) * rim, scale, traversal)
                    if price < best:
                        best, axis, event, flat_left = price, k, i, True
    return axis, event, flat_left


@jit
def _divide(cells: Cells, top: int, axis: int, event: int, flat_left: bool) -> None:
    """Puts the right child's triangles and events in their cell's place and the left's above it."""
    plane, size = cells.pos[axis, event], cells.size[axis]
    first, last = event, event + 1  # the plane's events, of which ends come first
    while first > 0 and cells.pos[axis, first - 1] == plane:
        first -= 1
    while last < size and cells.pos[axis, last] == plane:
        last += 1
    flat = last
    if not flat_left:
        flat = first
        while flat < last and cells.kind[axis, flat] == END:
            flat += 1
    here = cells.member[top]
    only_left = here & cells.ended[axis, flat]
    only_right = here & (cells.begun[axis, size] & ~cells.begun[axis, first]) & ~only_left
    cells.member[top + 1], cells.member[top] = here & ~only_right, here & ~only_left
    for k in range(3):
        events = cells.events[top, k]
        cells.events[top + 1, k] = _without(events, only_right, cells.own, k)
        cells.events[top, k] = _without(events, only_left, cells.own, k)
    cells.events[top + 1, axis] &= below(last)
    cells.events[top, axis] &= ~below(first)


@jit
def _without(events: np.uint64, gone: np.uint64, own: Sets, axis: int) -> np.uint64:
    """`events` of an axis but for those of the triangles that are `gone`."""
    while gone != NONE:
        events &= ~own[axis, lowest(gone)]
        gone &= gone - ONE
    return events
