"""The KD-tree: SAH in O(n log n) from one sort (Wald and Havran 2006), no clipping, empty leaves allowed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.build.grow import resized, resized_rows
from renderer.build.kd_events import TRIANGLES, Lists, Spans, classify, root_lists, split_lists, with_room
from renderer.build.kd_plane import best_plane
from renderer.build.refit import depth_of, sah_cost
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Bytes, Floats, Ints, Kd, SahCosts
from renderer.jit import jit


class Nodes(NamedTuple):
    """A `Kd`'s node arrays while they grow; `size` is its `count`."""

    lower: Floats
    upper: Floats
    split: Floats
    axis: Bytes
    child: Ints
    size: Ints
    parent: Ints


def build_kd(boxes: Floats, costs: SahCosts, max_depth: int = MAX_DEPTH) -> Kd:
    """The KD-tree over m >= 1 triangle bounds, (m, 2, 3) float32, finite; the root's cell is their union.

    Cells are cut at the cheapest of all their triangles' faces that lie strictly inside, a plane that cuts off
    empty space at 0.8 of its cost, until a leaf costs no more or the depth is `max_depth`. A triangle belongs to the
    left if its box ends at or before the plane, to the right if it begins at or after it, else to both; one that
    lies in the plane goes where that is cheaper. A cell without area is a leaf. Equal input gives equal bytes.
    Raises ValueError for no triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    lists, spans = root_lists(boxes, min(max_depth, MAX_DEPTH) + 2)
    nodes, refs = _split_all(lists, spans, _root_node(boxes), costs.traversal, costs.intersection)
    cost = sah_cost(nodes.lower, nodes.upper, nodes.axis == KD_LEAF, nodes.size, costs.traversal, costs.intersection)
    return Kd(
        lower=nodes.lower,
        upper=nodes.upper,
        split=nodes.split,
        axis=nodes.axis,
        child=nodes.child,
        count=nodes.size,
        parent=nodes.parent,
        refs=refs,
        depth=depth_of(nodes.parent),
        cost=cost,
    )


def _root_node(boxes: Floats) -> Nodes:
    """Room for as many nodes as there are triangles, with the root's cell."""
    room = len(boxes)
    nodes = Nodes(
        lower=np.empty((room, 3), np.float32),
        upper=np.empty((room, 3), np.float32),
        split=np.empty(room, np.float32),
        axis=np.empty(room, np.uint8),
        child=np.empty(room, np.int32),
        size=np.empty(room, np.int32),
        parent=np.empty(room, np.int32),
    )
    nodes.lower[0], nodes.upper[0], nodes.parent[0] = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0), -1
    return nodes


@jit
def _split_all(lists: Lists, spans: Spans, nodes: Nodes, traversal: float, intersection: float) -> tuple[Nodes, Ints]:
    """Splits cells depth first, left before right; the lists of the cells that wait lie on one another.

    At most one cell a level waits beside the two newest, so `spans` has two entries more than the depth allowed.
    """
    size = spans[0, TRIANGLES, 1]
    refs, side = np.empty(2 * size, np.int32), np.zeros(size, np.uint8)
    waiting, depths = np.zeros(len(spans), np.int64), np.zeros(len(spans), np.int64)
    top, made, filled = 1, 1, 0
    while top > 0:
        top -= 1
        node, depth, span = waiting[top], depths[top], spans[top]
        begin, end = span[TRIANGLES, 0], span[TRIANGLES, 1]
        axis, plane, planar_left = KD_LEAF, np.float32(0), True
        if depth < len(spans) - 2 and end > begin:
            axis, plane, planar_left = best_plane(
                lists.pos,
                lists.code,
                span,
                end - begin,
                nodes.lower[node],
                nodes.upper[node],
                traversal,
                intersection,
            )
        nodes.axis[node], nodes.split[node] = axis, plane
        if axis == KD_LEAF:
            nodes.child[node], nodes.size[node] = filled, end - begin
            if filled + end - begin > len(refs):
                refs = resized(refs, 2 * (filled + end - begin))
            for i in range(begin, end):
                refs[filled] = lists.triangle[i]
                filled += 1
            continue
        nodes = _with_children(nodes, node, made, axis, plane)
        lists = with_room(lists, span)
        classify(lists, span, axis, plane, planar_left, side)
        split_lists(lists, spans, top, axis, plane, side)
        waiting[top], waiting[top + 1] = made + 1, made
        depths[top], depths[top + 1] = depth + 1, depth + 1
        top += 2
        made += 2
    return _resized(nodes, made), resized(refs, filled)


@jit
def _with_children(nodes: Nodes, node: int, made: int, axis: int, plane: np.float32) -> Nodes:
    """Two children from slot `made` on, with the cells that the plane leaves them."""
    if made + 2 > len(nodes.axis):
        nodes = _resized(nodes, 2 * (made + 2))
    nodes.child[node], nodes.size[node] = made, 0
    for child in range(made, made + 2):
        for side in range(3):
            nodes.lower[child, side], nodes.upper[child, side] = nodes.lower[node, side], nodes.upper[node, side]
        nodes.parent[child] = node
    nodes.upper[made, axis], nodes.lower[made + 1, axis] = plane, plane
    return nodes


@jit
def _resized(nodes: Nodes, room: int) -> Nodes:
    return Nodes(
        resized_rows(nodes.lower, room),
        resized_rows(nodes.upper, room),
        resized(nodes.split, room),
        resized(nodes.axis, room),
        resized(nodes.child, room),
        resized(nodes.size, room),
        resized(nodes.parent, room),
    )
