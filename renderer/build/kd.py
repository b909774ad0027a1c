"""The KD-tree: SAH in O(n log n) from one sort, clipped or not, empty leaves allowed (Wald and Havran 2006)."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_columns
from renderer.build.kd_anew import clip_straddlers, nothing_anew
from renderer.build.kd_clip import Shapes, unclipped
from renderer.build.kd_events import TRIANGLES, Lists, Spans, classify, root_lists, split_lists, with_room
from renderer.build.kd_nodes import Nodes, Part, Waiting, cells_of, halve, joined, nodes_resized, room_for_nodes
from renderer.build.kd_plane import best_plane
from renderer.build.kd_small import FEW, finish, room_for_cells, take
from renderer.build.pad import around
from renderer.build.parallel import each
from renderer.build.progress import TOP_SHARE, Told, untold, within
from renderer.build.refit import depth_of, sah_cost
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Floats, Ints, Kd, SahCosts
from renderer.jit import jit

Words = npt.NDArray[np.uint32]

TASK = 1 << 14
"""Cells of at most so many triangles are a task of their own."""

NODES_EACH, REFS_EACH = 8, 10
"""Room for nodes, and for leaves' entries, a triangle; more is made where that is too little."""


class Rules(NamedTuple):
    """What a build goes by, as compiled code takes it; cells of at most `stop` triangles wait."""

    max_depth: int
    traversal: float
    intersection: float
    stop: int


def build_kd(
    boxes: Floats, costs: SahCosts, max_depth: int = MAX_DEPTH, shapes: Shapes | None = None, told: Told = untold
) -> Kd:
    """The KD-tree over m >= 1 triangle bounds, (m, 2, 3) float32, finite; the root's cell is their union.

    Cells are cut at the cheapest of all their triangles' faces that lie strictly inside, a plane that cuts off
    empty space at 0.8 of its cost, until a leaf costs no more or the depth is `max_depth`. A triangle belongs to the
    left if its box ends at or before the plane, to the right if it begins at or after it, else to both; one that
    lies in the plane goes where that is cheaper. With `shapes`, what of a triangle's shape lies in a cell takes the
    place of its box there. A cell without area is a leaf. Equal input gives equal bytes. Raises ValueError for no
    triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    shapes = shapes or unclipped(boxes)
    deepest = min(max_depth, MAX_DEPTH)
    lists, spans = root_lists(boxes, deepest + 2)
    root = np.stack(around(boxes))
    rules = Rules(deepest, costs.traversal, costs.intersection, TASK)
    first = _split_all(lists, spans, root, np.arange(len(boxes), dtype=np.int32), shapes, 0, rules)
    tasks = [
        partial(_waiting_part, first, cell, shapes, rules._replace(stop=0)) for cell in range(len(first.waiting.cells))
    ]
    nodes, refs = joined(first, each(tasks, within(told, TOP_SHARE, 1.0)))
    lower, upper, parent = cells_of(nodes, root)
    cost = sah_cost(lower, upper, nodes.axis == KD_LEAF, nodes.size, costs.traversal, costs.intersection)
    return Kd(
        lower=lower,
        upper=upper,
        split=nodes.split,
        axis=nodes.axis,
        child=nodes.child,
        count=nodes.size,
        parent=parent,
        refs=refs,
        depth=depth_of(parent),
        cost=cost,
    )


def _waiting_part(first: Part, cell: int, shapes: Shapes, rules: Rules) -> Part:
    depth = int(first.waiting.cells[cell, 1])
    span, kept = first.waiting.spans[cell], first.waiting.lists
    ids = kept.triangle[span[TRIANGLES, 0] : span[TRIANGLES, 1]].copy()
    sizes = span[:, 1] - span[:, 0]
    spans = np.zeros((rules.max_depth - depth + 2, 4, 2), np.int64)
    spans[0, :, 1] = sizes
    room = 2 * int(sizes.max())
    pos, code = np.empty((3, room), np.float32), np.empty((3, room), np.uint32)
    for row in range(3):
        begin, end = span[row]
        pos[row, : end - begin], code[row, : end - begin] = kept.pos[row, begin:end], kept.code[row, begin:end]
    lists = Lists(pos, code, np.arange(len(ids), dtype=np.int32))
    return _split_all(lists, spans, first.waiting.boxes[cell], ids, shapes, depth, rules)


@jit
def _split_all(lists: Lists, spans: Spans, root: Floats, ids: Ints, shapes: Shapes, level: int, rules: Rules) -> Part:
    """Splits the cell `root` (2, 3) and what becomes of it, depth first, left before right; the lists of the cells that
    wait lie on one another.

    `ids` names the lists' triangles in the scene. At most one cell a level waits beside the two newest, so `spans` has
    two entries more than the levels below `level` that are allowed.
    """
    size = spans[0, TRIANGLES, 1]
    nodes, refs = room_for_nodes(NODES_EACH * size + 2), np.empty(REFS_EACH * size, np.int32)
    side, rank = np.zeros(size, np.uint8), np.empty(size, np.uint32)
    waiting, depths = np.zeros(len(spans), np.int64), np.zeros(len(spans), np.int64)
    boxes = np.empty((len(spans), 2, 3), np.float32)
    boxes[0] = root
    cut_off, anew, small = _none_wait(), nothing_anew(), room_for_cells()
    depths[0] = level
    top, made, filled, cells = 1, 1, 0, 0
    while top > 0:
        top -= 1
        node, depth, span = waiting[top], depths[top], spans[top]
        begin, end = span[TRIANGLES, 0], span[TRIANGLES, 1]
        axis, plane, planar_left = KD_LEAF, np.float32(0), True
        if end - begin <= rules.stop and end > begin:
            cut_off = _wait(cut_off, cells, lists, span, node, depth, boxes[top], ids, rank)
            cells += 1
            nodes.axis[node], nodes.split[node], nodes.child[node], nodes.size[node] = axis, plane, filled, 0
            continue
        if end - begin <= FEW and len(shapes.triangles) == 0:
            take(small, lists, span, ids, boxes[top], rank)
            nodes, made, refs, filled = finish(
                small, node, depth, nodes, made, refs, filled, rules.max_depth, rules.traversal, rules.intersection
            )
            continue
        if depth < rules.max_depth and end > begin:
            axis, plane, planar_left = best_plane(
                lists.pos,
                lists.code,
                span,
                end - begin,
                boxes[top, 0],
                boxes[top, 1],
                rules.traversal,
                rules.intersection,
            )
        nodes.axis[node], nodes.split[node] = axis, plane
        if axis == KD_LEAF:
            nodes.child[node], nodes.size[node] = filled, end - begin
            if filled + end - begin > len(refs):
                refs = resized(refs, 2 * (filled + end - begin))
            for i in range(begin, end):
                refs[filled] = ids[lists.triangle[i]]
                filled += 1
            continue
        if made + 2 > len(nodes.axis):
            nodes = nodes_resized(nodes, 2 * (made + 2))
        nodes.child[node], nodes.size[node] = made, 0
        lists = with_room(lists, span)
        classify(lists, span, axis, plane, planar_left, side)
        halve(boxes[top], boxes[top], boxes[top + 1], axis, plane)
        if len(shapes.triangles) > 0:
            anew = clip_straddlers(lists.triangle[begin:end], side, ids, shapes, boxes[top + 1], boxes[top], anew)
        split_lists(lists, spans, top, axis, plane, side, anew)
        waiting[top], waiting[top + 1] = made + 1, made
        depths[top], depths[top + 1] = depth + 1, depth + 1
        top += 2
        made += 2
    kept = Waiting(cut_off.cells[:cells], cut_off.boxes[:cells], cut_off.spans[:cells], cut_off.lists)
    own = Nodes(nodes.split[:made], nodes.axis[:made], nodes.child[:made], nodes.size[:made])
    return Part(own, refs[:filled], kept)


@jit
def _none_wait() -> Waiting:
    lists = Lists(np.empty((3, 0), np.float32), np.empty((3, 0), np.uint32), np.empty(0, np.int32))
    return Waiting(np.zeros((0, 2), np.int64), np.zeros((0, 2, 3), np.float32), np.zeros((0, 4, 2), np.int64), lists)


@jit
def _with_cell(waiting: Waiting, cells: int, span: Spans) -> Waiting:
    """Room for one more cell with the lists at `span`."""
    places, boxes, spans, kept = waiting
    if cells == len(places):
        more = max(64, 2 * cells)
        wider, larger = np.zeros((more, 2), np.int64), np.zeros((more, 2, 3), np.float32)
        longer = np.zeros((more, 4, 2), np.int64)
        wider[:cells], larger[:cells], longer[:cells] = places, boxes, spans
        places, boxes, spans = wider, larger, longer
    most = 0
    for row in range(3):
        most = max(most, span[row, 1] - span[row, 0] + (spans[cells - 1, row, 1] if cells > 0 else 0))
    pos, code, triangle = kept.pos, kept.code, kept.triangle
    if most > pos.shape[1]:
        pos, code = resized_columns(pos, 2 * most), resized_columns(code, 2 * most)
    most = span[TRIANGLES, 1] - span[TRIANGLES, 0] + (spans[cells - 1, TRIANGLES, 1] if cells > 0 else 0)
    if most > len(triangle):
        triangle = resized(triangle, 2 * most)
    return Waiting(places, boxes, spans, Lists(pos, code, triangle))


@jit
def _wait(
    waiting: Waiting,
    cells: int,
    lists: Lists,
    span: Spans,
    node: int,
    depth: int,
    box: Floats,
    ids: Ints,
    rank: Words,
) -> Waiting:
    """Appends a cell, its triangles named by their rank; what is there must be a multiple of its own size."""
    waiting = _with_cell(waiting, cells, span)
    kept, spans = waiting.lists, waiting.spans
    waiting.cells[cells, 0], waiting.cells[cells, 1] = node, depth
    waiting.boxes[cells] = box
    for row in range(4):
        spans[cells, row, 0] = spans[cells - 1, row, 1] if cells > 0 else 0
        spans[cells, row, 1] = spans[cells, row, 0] + span[row, 1] - span[row, 0]
    to = spans[cells, TRIANGLES, 0]
    for i in range(span[TRIANGLES, 0], span[TRIANGLES, 1]):
        one = lists.triangle[i]
        rank[one] = i - span[TRIANGLES, 0]
        kept.triangle[to] = ids[one]
        to += 1
    for row in range(3):
        to = spans[cells, row, 0]
        for i in range(span[row, 0], span[row, 1]):
            code = lists.code[row, i]
            kept.pos[row, to] = lists.pos[row, i]
            kept.code[row, to] = (rank[code >> np.uint32(2)] << np.uint32(2)) | (code & np.uint32(3))
            to += 1
    return waiting
