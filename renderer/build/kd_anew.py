"""The events of what a plane cuts: a triangle's clipped parts in both children (Wald and Havran 2006, section 4.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.kd_clip import CORNERS, Shapes, clipped_box
from renderer.build.kd_plane import END, START
from renderer.build.tree import Bytes, Floats, Ints
from renderer.jit import jit

Words = npt.NDArray[np.uint32]
Counts = npt.NDArray[np.int64]

ON_LEFT, ON_RIGHT, ON_BOTH, ANEW = 1, 2, 3, 4
"""Bits of a triangle's side; ANEW beside them: its events are made anew."""

FEW = 32
"""So many events are sorted by insertion."""


class Anew(NamedTuple):
    """Events by child, the left one's first, and axis, each list in order: `pos`, `code` (2, 3, c), `size` (2, 3)."""

    pos: Floats
    code: Words
    size: Counts


@jit
def nothing_anew() -> Anew:
    """No events."""
    return Anew(np.empty((2, 3, 0), np.float32), np.empty((2, 3, 0), np.uint32), np.zeros((2, 3), np.int64))


@jit
def clip_straddlers(
    triangles: Ints,
    side: Bytes,
    ids: Ints,
    shapes: Shapes,
    left: Floats,
    right: Floats,
    anew: Anew,
) -> Anew:
    """Clips those of a cell's `triangles` that are ON_BOTH to the children, sets their side and makes their events.

    `left` and `right` (2, 3) are the children's cells; `ids` names them in `shapes`. Returns `anew`, or a larger one.
    """
    straddlers = 0
    for one in triangles:
        straddlers += side[one] == ON_BOTH
    if 2 * straddlers > anew.pos.shape[2]:
        room = 4 * straddlers
        anew = Anew(np.empty((2, 3, room), np.float32), np.empty((2, 3, room), np.uint32), anew.size)
    starts = np.zeros((2, 3), np.int64)
    anew.size[:] = 0
    cells = (left, right)
    work, box = np.empty((2, CORNERS, 3), np.float64), np.empty(6, np.float32)
    for one in triangles:
        if side[one] != ON_BOTH:
            continue
        where = 0
        for child in range(2):
            if not clipped_box(shapes, ids[one], cells[child][0], cells[child][1], work, box):
                continue
            where |= 1 << child
            code = np.uint32(one) << np.uint32(2)
            for k in range(3):
                if box[k + 3] < cells[child][1, k]:
                    at = anew.size[child, k]
                    anew.pos[child, k, at], anew.code[child, k, at] = box[k + 3], code | np.uint32(END)
                    anew.size[child, k] += 1
                if box[k] > cells[child][0, k]:
                    at = straddlers + starts[child, k]
                    anew.pos[child, k, at], anew.code[child, k, at] = box[k], code | np.uint32(START)
                    starts[child, k] += 1
        # A triangle must not be lost, whatever rounding says: where no part is found, its box is cut.
        side[one] = where | ANEW if where else ON_BOTH
    for child in range(2):
        for k in range(3):
            _close_up(anew.pos[child, k], anew.code[child, k], anew.size[child, k], straddlers, starts[child, k])
            anew.size[child, k] += starts[child, k]
            _sort(anew.pos[child, k], anew.code[child, k], anew.size[child, k])
    return anew


@jit
def _close_up(pos: Floats, code: Words, ends: int, begin: int, starts: int) -> None:
    for i in range(starts):
        pos[ends + i], code[ends + i] = pos[begin + i], code[begin + i]


@jit
def _sort(pos: Floats, code: Words, size: int) -> None:
    """By position, stably: ends lie before starts."""
    if size <= FEW:
        for i in range(1, size):
            key, which, at = pos[i], code[i], i
            while at > 0 and pos[at - 1] > key:
                pos[at], code[at] = pos[at - 1], code[at - 1]
                at -= 1
            pos[at], code[at] = key, which
        return
    order = np.argsort(pos[:size], kind="mergesort")
    sorted_pos, sorted_code = pos[:size][order], code[:size][order]
    for i in range(size):
        pos[i], code[i] = sorted_pos[i], sorted_code[i]


@jit
def _after(at: np.float32, code: np.uint32, other: np.float32, other_code: np.uint32) -> bool:
    return bool(at > other or (at == other and (code & np.uint32(3)) > (other_code & np.uint32(3))))


@jit
def merged_up(pos: Floats, code: Words, begin: int, end: int, anew: Anew, axis: int) -> int:
    """Merges the right child's new events into the list from `begin` to `end`, last first; returns its new end."""
    new_pos, new_code, left = anew.pos[1, axis], anew.code[1, axis], anew.size[1, axis]
    to, at = end + left, end
    while left > 0:
        to -= 1
        if at > begin and _after(pos[at - 1], code[at - 1], new_pos[left - 1], new_code[left - 1]):
            at -= 1
            pos[to], code[to] = pos[at], code[at]
        else:
            left -= 1
            pos[to], code[to] = new_pos[left], new_code[left]
    return int(end + anew.size[1, axis])


@jit
def merged_down(pos: Floats, code: Words, to: int, begin: int, end: int, anew: Anew, axis: int) -> int:
    """Moves the list from `begin` to `end` down to `to`, with the left child's new events; returns its new end.

    What is there must be at least as far away as there are new events.
    """
    new_pos, new_code, size = anew.pos[0, axis], anew.code[0, axis], anew.size[0, axis]
    taken = 0
    for at in range(begin, end):
        while taken < size and _after(pos[at], code[at], new_pos[taken], new_code[taken]):
            pos[to], code[to] = new_pos[taken], new_code[taken]
            taken, to = taken + 1, to + 1
        pos[to], code[to] = pos[at], code[at]
        to += 1
    while taken < size:
        pos[to], code[to] = new_pos[taken], new_code[taken]
        taken, to = taken + 1, to + 1
    return to
