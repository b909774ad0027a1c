"""Better BVHs: nodes are taken out and put in where they cost least (Bittner, Hapala and Havran 2013).

In batches (Meister and Bittner 2018): the best place of every candidate is searched for in the same tree, and of moves
that touch the same nodes only the best is made.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from renderer.build.loose import Loose, adopt, copied, copy_node, fit_upward, sibling_of, union_area
from renderer.build.parallel import each
from renderer.build.tree import Floats, Ints, half_areas
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

CHUNK = 2048
"""Candidates of one task."""


def reinserted(tree: Loose, share: float) -> Loose:
    """A copy of `tree` after one batch, of the `share` of its nodes whose areas are largest."""
    found = _candidates(tree.box, tree.parent, share)
    tasks = [partial(_search, *tree, found[at : at + CHUNK]) for at in range(0, len(found), CHUNK)]
    after = copied(tree)
    if tasks:
        moves = each(tasks)
        to, gain = np.concatenate([move[0] for move in moves]), np.concatenate([move[1] for move in moves])
        best_first = np.argsort(-gain, kind="stable")
        _move_all(*after, found[best_first], to[best_first])
    return after


def _candidates(box: Floats, parent: Ints, share: float) -> Ints:
    """The nodes of the largest area, but for the root and its children; of equal areas the first."""
    area = half_areas(box[:, 3:].astype(np.float64) - box[:, :3])
    area[parent <= 0] = -1.0
    wanted = min(int(np.ceil(share * len(area))), int((parent > 0).sum()))
    return np.argsort(-area, kind="stable")[:wanted].astype(np.int32)


@jit
def _search(box: Floats, child: Ints, count: Ints, parent: Ints, nodes: Ints) -> tuple[Ints, Doubles]:
    """For each of `nodes` where it is best put in as a sibling, -1 for nowhere, and the area that is won."""
    to, gain = np.full(len(nodes), np.int32(-1)), np.zeros(len(nodes), np.float64)
    stack, limits = np.empty(256, np.int32), np.empty(256, np.float64)
    pivot = np.empty((1, 6), np.float32)
    for i in range(len(nodes)):
        to[i], gain[i] = _best_place(box, child, count, parent, nodes[i], stack, limits, pivot)
    return to, gain


@jit
def _best_place(
    box: Floats, child: Ints, count: Ints, parent: Ints, node: int, stack: Ints, limits: Doubles, pivot: Floats
) -> tuple[int, float]:
    """The search goes up from the node, and at each ancestor into the other side, as deep as it can still win."""
    own, up, side = union_area(box, node, node), parent[node], sibling_of(child, parent, node)
    won, gain, to = union_area(box, up, up), 0.0, -1
    stay, at = side, up
    for k in range(6):
        pivot[0, k] = box[side, k]
    while True:
        stack[0], limits[0], top = side, won, 1
        while top > 0:
            top -= 1
            there, limit = stack[top], limits[top]
            if limit - own <= gain:
                continue
            left = limit - union_area(box, there, node)
            if left > gain and there != stay:
                gain, to = left, there
            if count[there] == 0 and top + 2 <= len(stack):
                below = left + union_area(box, there, there)
                stack[top], limits[top] = child[there] + 1, below
                stack[top + 1], limits[top + 1] = child[there], below
                top += 2
        if at != up:
            for k in range(3):
                pivot[0, k] = min(pivot[0, k], box[side, k])
                pivot[0, k + 3] = max(pivot[0, k + 3], box[side, k + 3])
            won += union_area(box, at, at) - union_area(pivot, 0, 0)
        if at == 0:
            return to, gain
        side, at = sibling_of(child, parent, at), parent[at]


@jit
def _move_all(box: Floats, child: Ints, count: Ints, parent: Ints, nodes: Ints, to: Ints) -> None:
    """Makes the moves in turn but for those that touch a node that an earlier one touched."""
    touched = np.zeros(len(child), np.uint8)
    for i in range(len(nodes)):
        node, there = nodes[i], to[i]
        if there < 0:
            continue
        side, up = sibling_of(child, parent, node), parent[node]
        over = parent[there]
        if touched[node] | touched[there] | touched[side] | touched[up] | touched[over]:
            continue
        touched[node], touched[there], touched[side], touched[up], touched[over] = 1, 1, 1, 1, 1
        _move(box, child, count, parent, node, there, side, up)
        fit_upward(box, child, parent, parent[up])
        fit_upward(box, child, parent, parent[node])


@jit
def _move(box: Floats, child: Ints, count: Ints, parent: Ints, node: int, there: int, side: int, up: int) -> None:
    """Puts `node` beside what is at `there`; the pair of places that it had with `side` serves the two."""
    copy_node(box, child, count, side, up)
    adopt(child, count, parent, up)
    copy_node(box, child, count, there, side)
    adopt(child, count, parent, side)
    child[there], count[there] = min(node, side), 0
    parent[node], parent[side] = there, there
