"""Better BVHs, one node at a time: a node goes, and its two children are put in where each costs least.

Bittner, Hapala and Havran 2013, with their measure of which nodes serve badly. Moving two at once gets on where no
single move (`reinsert`) wins anything.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.insertion import ROOM, best_place, put_in, take_out
from renderer.build.loose import Loose, copied, union_area
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
    stack, induced = np.empty(ROOM, np.int32), np.empty(ROOM, np.float64)
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
    below = child[node]
    first = below if union_area(box, below, below) >= union_area(box, below + 1, below + 1) else below + 1
    second = 2 * below + 1 - first
    for k in range(6):
        out[0, k], out[1, k] = box[first, k], box[second, k]
    links = (child[first], count[first], child[second], count[second])
    pair = take_out(box, child, count, parent, node)
    there, _ = best_place(box, child, count, out[:1], np.inf, stack, induced)
    put_in(box, child, count, parent, pair, pair + 1, out[:1], links[0], links[1], there)
    there, _ = best_place(box, child, count, out[1:], np.inf, stack, induced)
    put_in(box, child, count, parent, below, below + 1, out[1:], links[2], links[3], there)
