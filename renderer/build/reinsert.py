"""Better BVHs: nodes are taken out and put in where they cost least (Bittner, Hapala and Havran 2013).

In batches (Meister and Bittner 2018): the best place of every candidate is searched for in the same tree, and of moves
that touch the same nodes only the best is made.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from renderer.build.loose import Loose, reach_of
from renderer.build.parallel import each
from renderer.build.tree import Floats, Ints
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]

CHUNK = 2048
"""Candidates of one task."""

LEAST_GAIN = 1e-4
"""Of all inner nodes' areas: rounds that win less are the last."""


def reinserted(
    tree: Loose, max_depth: int, rounds: int, share: float, say: Callable[[int, int], None] = lambda done, of: None
) -> Loose:
    """`tree` after at most `rounds` batches of `share` of its nodes, those of the largest area.

    Rounds end early where little is won, and before the tree would be deeper than `max_depth`. `say` is told how many
    rounds are over, and of how many.
    """
    for done in range(rounds):
        say(done, rounds)
        found = _candidates(tree.box, tree.parent, share)
        if len(found) == 0:
            break
        tasks = [partial(_search, *tree, found[at : at + CHUNK]) for at in range(0, len(found), CHUNK)]
        moves = each(tasks)
        to, gain = np.concatenate([move[0] for move in moves]), np.concatenate([move[1] for move in moves])
        best_first = np.argsort(-gain, kind="stable")
        before = tree
        after = Loose(tree.box.copy(), tree.child.copy(), tree.slots.copy(), tree.parent.copy())
        won = _move_all(*after, found[best_first], to[best_first], gain[best_first])
        tree = after if reach_of(after) <= max_depth else before
        if tree is before or won <= LEAST_GAIN * _inner_area(before.box, before.slots):
            break
    return tree


def _candidates(box: Floats, parent: Ints, share: float) -> Ints:
    """The nodes of the largest area, but for the root and its children; of equal areas the first."""
    low, high = box[:, :3].astype(np.float64), box[:, 3:].astype(np.float64)
    x, y, z = (high - low).T
    area = x * y + z * (x + y)
    area[parent <= 0] = -1.0
    wanted = min(int(np.ceil(share * len(area))), int((parent > 0).sum()))
    return np.argsort(-area, kind="stable")[:wanted].astype(np.int32)


@jit
def _inner_area(box: Floats, count: Ints) -> float:
    total = 0.0
    for node in range(len(count)):
        if count[node] == 0:
            total += _union_area(box, node, node)
    return total


@jit
def _union_area(box: Floats, a: int, b: int) -> float:
    x = np.float64(max(box[a, 3], box[b, 3])) - np.float64(min(box[a, 0], box[b, 0]))
    y = np.float64(max(box[a, 4], box[b, 4])) - np.float64(min(box[a, 1], box[b, 1]))
    z = np.float64(max(box[a, 5], box[b, 5])) - np.float64(min(box[a, 2], box[b, 2]))
    return x * y + z * (x + y)


@jit
def _sibling(child: Ints, parent: Ints, node: int) -> int:
    left = int(child[parent[node]])
    return left + 1 if node == left else left


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
    own, up, side = _union_area(box, node, node), parent[node], _sibling(child, parent, node)
    won, gain, to = _union_area(box, up, up), 0.0, -1
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
            left = limit - _union_area(box, there, node)
            if left > gain and there != stay:
                gain, to = left, there
            if count[there] == 0 and top + 2 <= len(stack):
                below = left + _union_area(box, there, there)
                stack[top], limits[top] = child[there] + 1, below
                stack[top + 1], limits[top + 1] = child[there], below
                top += 2
        if at != up:
            for k in range(3):
                pivot[0, k] = min(pivot[0, k], box[side, k])
                pivot[0, k + 3] = max(pivot[0, k + 3], box[side, k + 3])
            won += _union_area(box, at, at) - _union_area(pivot, 0, 0)
        if at == 0:
            return to, gain
        side, at = _sibling(child, parent, at), parent[at]


@jit
def _move_all(box: Floats, child: Ints, count: Ints, parent: Ints, nodes: Ints, to: Ints, gain: Doubles) -> float:
    """Makes the moves in turn but for those that touch a node that an earlier one touched; returns what they won."""
    touched = np.zeros(len(child), np.uint8)
    won = 0.0
    for i in range(len(nodes)):
        node, there = nodes[i], to[i]
        if there < 0:
            continue
        side, up = _sibling(child, parent, node), parent[node]
        over = parent[there]
        if touched[node] | touched[there] | touched[side] | touched[up] | touched[over]:
            continue
        touched[node], touched[there], touched[side], touched[up], touched[over] = 1, 1, 1, 1, 1
        won += gain[i]
        _move(box, child, count, parent, node, there, side, up)
        _fit_upward(box, child, parent, parent[up])
        _fit_upward(box, child, parent, parent[node])
    return won


@jit
def _move(box: Floats, child: Ints, count: Ints, parent: Ints, node: int, there: int, side: int, up: int) -> None:
    """Puts `node` beside what is at `there`; the pair of places that it had with `side` serves the two."""
    _copy(box, child, count, side, up)
    _adopt(child, count, parent, up)
    _copy(box, child, count, there, side)
    _adopt(child, count, parent, side)
    child[there], count[there] = min(node, side), 0
    parent[node], parent[side] = there, there


@jit
def _copy(box: Floats, child: Ints, count: Ints, source: int, target: int) -> None:
    for k in range(6):
        box[target, k] = box[source, k]
    child[target], count[target] = child[source], count[source]


@jit
def _adopt(child: Ints, count: Ints, parent: Ints, node: int) -> None:
    if count[node] == 0:
        parent[child[node]], parent[child[node] + 1] = node, node


@jit
def _fit_upward(box: Floats, child: Ints, parent: Ints, start: int) -> None:
    node = start
    while node >= 0:
        left = child[node]
        for k in range(3):
            box[node, k] = min(box[left, k], box[left + 1, k])
            box[node, k + 3] = max(box[left, k + 3], box[left + 1, k + 3])
        node = parent[node]
