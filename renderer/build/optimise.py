"""How long a BVH is worked on by re-insertion and by treelets, and in what turn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from renderer.build.loose import Loose, reach_of
from renderer.build.progress import Told
from renderer.build.reinsert import reinserted
from renderer.build.reinsert_pairs import pairs_reinserted
from renderer.build.tree import SahCosts
from renderer.build.treelets import regrouped

Round = Callable[[Loose, SahCosts], Loose]


def single(tree: Loose, costs: SahCosts) -> Loose:
    """Nodes are moved one by one; what a leaf costs is not looked at."""
    return reinserted(tree, share=0.3)


def pairs(tree: Loose, costs: SahCosts) -> Loose:
    """Both children of a node are moved at once."""
    return pairs_reinserted(tree, share=0.02)


SHORT: Sequence[Round] = (single,) * 4
LONG: Sequence[Round] = (*SHORT, *(pairs,) * 6, *(single,) * 3, regrouped, regrouped)
"""Single moves win most at first, pairs get on where these end, single moves tidy up after them, and treelets find what
no move does."""


def optimised(tree: Loose, rounds: Sequence[Round], costs: SahCosts, max_depth: int, told: Told) -> Loose:
    """`tree` after all `rounds`; what one makes deeper than `max_depth` is left out."""
    for number, work in enumerate(rounds):
        after = work(tree, costs)
        if reach_of(after) <= max_depth:
            tree = after
        told((number + 1) / len(rounds))
    return tree
