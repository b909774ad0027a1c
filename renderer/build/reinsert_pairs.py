"""Better BVHs, one node at a time: a node goes, and its two children are put in where each costs least.

Bittner, Hapala and Havran 2013, with their measure of which nodes serve badly. Moving two at once gets on where no
single move (`reinsert`) wins anything.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.loose import Loose, adopt, copied, copy_node, fit_upward, sibling_of, union_area
from renderer.build.tree import Floats, Ints, half_areas
from renderer.jit import jit

Doubles = npt.NDArray[np.float64]


def pairs_reinserted(tree: Loose, share: float) -> Loose:
    """A copy of `tree` in which the worst `share` of its nodes were taken out, one after the other."""
    after = copied(tree)
    _scatter_all(*after, _worst(tree, share))
    return after


def _worst(tree: Loose, share: float) -> Ints:
    """Inner nodes by area, cubed, over the mean and the least of their children's areas, the worst first."""
    area = half_areas(tree.box[:, 3:].astype(np.float64) - tree.box[:, :3])
    inner = (tree.size == 0) & (tree.parent > 0)
    one, other = np.ones_like(area), np.ones_like(area)
    one[inner], other[inner] = area[tree.child[inner]], area[tree.child[inner] + 1]
    tiny = np.finfo(np.float64).tiny
    with np.errstate(over="ignore"):
        score = area * (area / np.maximum(one + other, tiny)) * (area / np.maximum(np.minimum(one, other), tiny))
    wanted = min(int(np.ceil(share * len(area))), int(inner.sum()))
    return np.argsort(np.where(inner, -score, np.inf), kind="stable")[:wanted].astype(np.int32)


@jit
def _scatter_all(box: Floats, child: Ints, count: Ints, parent: Ints, nodes: Ints) -> None:
    stack, induced = np.empty(512, np.int32), np.empty(512, np.float64)
    out = np.empty((2, 6), np.float32)
    for node in nodes:
        # An earlier move may have put a leaf or a child of the root there.
        if count[node] == 0 and parent[node] > 0:
            _scatter(box, child, count, parent, node, out, stack, induced)


@jit
def _scatter(
    box: Floats, child: Ints, count: Ints, parent: Ints, node: int, out: Floats, stack: Ints, induced: Doubles
) -> None:
    """Takes `node` out and puts its children in, the larger one first; two pairs of places become free and are used."""
    up, side, below = parent[node], sibling_of(child, parent, node), child[node]
    first = below if union_area(box, below, below) >= union_area(box, below + 1, below + 1) else below + 1
    second = 2 * below + 1 - first
    for k in range(6):
        out[0, k], out[1, k] = box[first, k], box[second, k]
    links = (child[first], count[first], child[second], count[second])
    pair = min(node, side)
    copy_node(box, child, count, side, up)
    adopt(child, count, parent, up)
    fit_upward(box, child, parent, parent[up])
    _put_in(box, child, count, parent, pair, out[:1], links[0], links[1], stack, induced)
    _put_in(box, child, count, parent, below, out[1:], links[2], links[3], stack, induced)


@jit
def _put_in(
    box: Floats,
    child: Ints,
    count: Ints,
    parent: Ints,
    pair: int,
    own: Floats,
    link: int,
    size: int,
    stack: Ints,
    induced: Doubles,
) -> None:
    """Puts a subtree with the box `own` (1, 6) at its best place; the places `pair` and `pair` + 1 are free for it."""
    there = _best_place(box, child, count, own, stack, induced)
    for k in range(6):
        box[pair, k] = own[0, k]
    child[pair], count[pair] = link, size
    adopt(child, count, parent, pair)
    copy_node(box, child, count, there, pair + 1)
    adopt(child, count, parent, pair + 1)
    child[there], count[there] = pair, 0
    parent[pair], parent[pair + 1] = there, there
    fit_upward(box, child, parent, there)


@jit
def _best_place(box: Floats, child: Ints, count: Ints, own: Floats, stack: Ints, induced: Doubles) -> int:
    """The node beside which `own` adds least area, from the root down, the child that grows less first."""
    alone = _area_with(own, 0, own)
    best, to = np.inf, child[0]
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
    return int(to)


@jit
def _area_with(box: Floats, node: int, own: Floats) -> float:
    x = np.float64(max(box[node, 3], own[0, 3])) - np.float64(min(box[node, 0], own[0, 0]))
    y = np.float64(max(box[node, 4], own[0, 4])) - np.float64(min(box[node, 1], own[0, 1]))
    z = np.float64(max(box[node, 5], own[0, 5])) - np.float64(min(box[node, 2], own[0, 2]))
    return x * y + z * (x + y)
