"""How a node is taken out of a tree, and put in where it costs least (Bittner, Hapala and Havran 2013)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.loose import adopt, copy_node, fit_upward, sibling_of, union_area
from renderer.build.tree import Floats, Ints
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

ROOM = 512
"""Entries of the two stacks of `best_place`."""


@jit
def take_out(box: Floats, child: Ints, count: Ints, parent: Ints, node: int) -> int:
    """Puts a node's sibling in their parent's place; returns the first of the two places that are free."""
    up, side = parent[node], sibling_of(child, parent, node)
    copy_node(box, child, count, side, up)
    adopt(child, count, parent, up)
    fit_upward(box, child, parent, parent[up])
    return int(min(node, side))


@jit
def best_place(
    box: Floats, child: Ints, count: Ints, own: Floats, limit: float, stack: Ints, induced: Doubles
) -> tuple[int, float]:
    """The node beside which a box, `own` (1, 6), adds least area to inner nodes, and that area; -1 where none is below
    the limit. From the root down, the child that grows less first; never beside the root."""
    alone = _area_with(own, 0, own)
    best, to = limit, -1
    stack[0], induced[0], top = 0, 0.0, 1
    while top > 0:
        top -= 1
        node, before = stack[top], induced[top]
        if before + alone >= best:
            continue
        cost = before + _area_with(box, node, own)
        if cost < best and node != 0:
            best, to = cost, node
        below = cost - union_area(box, node, node)
        if count[node] > 0 or below + alone >= best or top + 2 > len(stack):
            continue
        left = child[node]
        grown = _area_with(box, left, own) - union_area(box, left, left)
        near = left if grown <= _area_with(box, left + 1, own) - union_area(box, left + 1, left + 1) else left + 1
        stack[top], stack[top + 1] = 2 * left + 1 - near, near
        induced[top], induced[top + 1] = below, below
        top += 2
    return int(to), best


@jit
def put_in(
    box: Floats,
    child: Ints,
    count: Ints,
    parent: Ints,
    at: int,
    other: int,
    own: Floats,
    link: int,
    size: int,
    there: int,
) -> None:
    """Puts a subtree with the box `own` (1, 6) beside `there`: it at `at`, what was `there` at `other`, a free pair."""
    for k in range(6):
        box[at, k] = own[0, k]
    child[at], count[at] = link, size
    adopt(child, count, parent, at)
    copy_node(box, child, count, there, other)
    adopt(child, count, parent, other)
    child[there], count[there] = min(at, other), 0
    parent[at], parent[other] = there, there
    fit_upward(box, child, parent, there)


@jit
def _area_with(box: Floats, node: int, own: Floats) -> float:
    x = np.float64(max(box[node, 3], own[0, 3])) - np.float64(min(box[node, 0], own[0, 0]))
    y = np.float64(max(box[node, 4], own[0, 4])) - np.float64(min(box[node, 1], own[0, 1]))
    z = np.float64(max(box[node, 5], own[0, 5])) - np.float64(min(box[node, 2], own[0, 2]))
    return x * y + z * (x + y)
