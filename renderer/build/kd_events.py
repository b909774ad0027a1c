"""The event lists of a KD build and how a plane splits them (Wald and Havran 2006, section 4.3).

What a straddling triangle has in a child is a box cut by the child's cell. Events on the cell's faces, where no plane
is ever taken, are left out: what crosses the lower face is known from the count. Without clipping, splitting a list is
a stable filter then. With it, the straddlers' events are made anew and merged.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_columns
from renderer.build.kd_anew import ON_BOTH, ON_LEFT, ON_RIGHT, Anew, merged_down, merged_up
from renderer.build.kd_plane import END, PLANAR, START
from renderer.build.parallel import each
from renderer.build.radix import sort_keys, stable_order
from renderer.build.tree import Bytes, Floats, Ints
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
Spans = npt.NDArray[np.int64]
"""(cells, 4, 2): the begin and end of each of a waiting cell's four lists; `span` is one cell's (4, 2)."""

TRIANGLES = 3
"""The row of a span that is the triangle list's; rows 0 to 2 are the axes' event lists."""


class Lists(NamedTuple):
    """Stacks of lists for the cells that wait: events per axis, `pos` and `code` (3, c), and ascending `triangle`."""

    pos: Floats
    code: Words
    triangle: Ints


def root_lists(boxes: Floats, cells: int) -> tuple[Lists, Spans]:
    """The sorted lists of all m `boxes` (m, 2, 3), and spans for `cells` waiting cells, the root's first."""
    axes = each([partial(_sorted_events, boxes[:, 0, axis], boxes[:, 1, axis]) for axis in range(3)])
    pos, code = np.empty((3, 2 * len(boxes)), np.float32), np.empty((3, 2 * len(boxes)), np.uint32)
    spans = np.zeros((cells, 4, 2), np.int64)
    spans[0, TRIANGLES, 1] = len(boxes)
    for axis, (positions, codes) in enumerate(axes):
        pos[axis, : len(codes)], code[axis, : len(codes)] = positions, codes
        spans[0, axis, 1] = len(codes)
    return Lists(pos, code, np.arange(len(boxes), dtype=np.int32)), spans


def _sorted_events(low: Floats, high: Floats) -> tuple[Floats, Words]:
    """One axis's events by position, then kind, then triangle: kinds are concatenated in order, the sort is stable."""
    flat = low == high
    solid = np.flatnonzero(~flat).astype(np.uint32)
    planar = np.flatnonzero(flat).astype(np.uint32)
    pos = np.concatenate([high[solid], low[planar], low[solid]])
    code = np.concatenate([solid << 2 | END, planar << 2 | PLANAR, solid << 2 | START]).astype(np.uint32)
    order = stable_order(sort_keys(pos))
    return pos[order], code[order]


@jit
def with_room(lists: Lists, span: Spans) -> Lists:
    """`lists`, moved to twice the room where what a split of the cell at `span` writes may not fit."""
    size = span[TRIANGLES, 1] - span[TRIANGLES, 0]
    most = 0
    for axis in range(3):
        most = max(most, 2 * span[axis, 1] - span[axis, 0] + 4 * size)
    pos, code, triangle = lists.pos, lists.code, lists.triangle
    if most > pos.shape[1]:
        pos, code = resized_columns(pos, 2 * most), resized_columns(code, 2 * most)
    most = span[TRIANGLES, 1] + size
    if most > len(triangle):
        triangle = resized(triangle, 2 * most)
    return Lists(pos, code, triangle)


@jit
def classify(lists: Lists, span: Spans, axis: int, plane: np.float32, planar_left: bool, side: Bytes) -> None:
    """Sets side[triangle] for every triangle of the cell: on one side only if its box ends there."""
    for i in range(span[TRIANGLES, 0], span[TRIANGLES, 1]):
        side[lists.triangle[i]] = ON_BOTH
    for i in range(span[axis, 0], span[axis, 1]):
        at, kind = lists.pos[axis, i], lists.code[axis, i] & np.uint32(3)
        triangle = lists.code[axis, i] >> np.uint32(2)
        if kind != START and (at < plane or (at == plane and (kind == END or planar_left))):
            side[triangle] = ON_LEFT
        elif kind != END and at >= plane:
            side[triangle] = ON_RIGHT


@jit
def split_lists(lists: Lists, spans: Spans, top: int, axis: int, plane: np.float32, side: Bytes, anew: Anew) -> None:
    """Replaces the topmost cell's lists, at spans[top], by its right child's and on them, at top + 1, its left's."""
    for row in range(3):
        low, high = np.float32(-np.inf), np.float32(np.inf)
        if row == axis:
            low, high = plane, plane
        begin, end = spans[top, row, 0], spans[top, row, 1]
        middle, end = _split_events(lists.pos[row], lists.code[row], begin, end, low, high, side, anew, row)
        spans[top, row, 1], spans[top + 1, row, 0], spans[top + 1, row, 1] = middle, middle, end
    begin, end = spans[top, TRIANGLES, 0], spans[top, TRIANGLES, 1]
    middle, end = _split_triangles(lists.triangle, begin, end, side)
    spans[top, TRIANGLES, 1], spans[top + 1, TRIANGLES, 0], spans[top + 1, TRIANGLES, 1] = middle, middle, end


@jit
def _split_events(
    pos: Floats,
    code: Words,
    begin: int,
    end: int,
    low: np.float32,
    high: np.float32,
    side: Bytes,
    anew: Anew,
    row: int,
) -> tuple[int, int]:
    """Keeps the right's events (not below `low`) in place, the left's (not above `high`) after them.

    Written without branches: each event goes to both ends, and only the ends that keep it move on.
    """
    aside = end + anew.size[0, row] + anew.size[1, row]
    right, left = begin, aside
    for i in range(begin, end):
        at, which = pos[i], code[i]
        where = side[which >> np.uint32(2)]
        kept = where & np.uint8(3 * (1 - (where >> 2)))
        pos[right], code[right] = at, which
        pos[left], code[left] = at, which
        right += int((kept >> 1) & (at >= low))
        left += int((kept & 1) & (at <= high))
    middle = merged_up(pos, code, begin, right, anew, row)
    return middle, merged_down(pos, code, middle, aside, left, anew, row)


@jit
def _split_triangles(triangle: Ints, begin: int, end: int, side: Bytes) -> tuple[int, int]:
    right, left = begin, end
    for i in range(begin, end):
        one = triangle[i]
        triangle[right] = one
        triangle[left] = one
        right += int((side[one] >> 1) & 1)
        left += int(side[one] & 1)
    for i in range(left - end):
        triangle[right + i] = triangle[end + i]
    return right, right + left - end
