"""BVHs that cost less than a sweep's: with spatial splits, with re-insertion and treelets, or with all three.

Leaves are merged last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.build.bvh import build_bvh
from renderer.build.loose import Loose, loosened, settled
from renderer.build.optimise import LONG, SHORT, Round, optimised
from renderer.build.progress import Told, untold, within
from renderer.build.sbvh import References, split_down
from renderer.build.spatial import spatial_order
from renderer.build.tree import MAX_DEPTH, Bvh, Floats, SahCosts

SINGLES = SahCosts(0.0, 1.0)
"""With visits that cost nothing a full sweep goes down to single triangles, unless their boxes are the same."""


@dataclass(frozen=True)
class Refinement:
    """How a tree is made: planes in space are taken where they cost less than `split` of the best object split, so 0
    takes none; then `rounds` of what makes it better."""

    split: float
    rounds: Sequence[Round]


REFINEMENTS = {
    "reinserted": Refinement(0.0, SHORT),
    "sbvh": Refinement(1.0, ()),
    "sbvh-reinserted": Refinement(0.85, LONG),
}
"""The builders of this file by their names. Re-insertion itself wins what splits that win little would."""


def build_refined(
    boxes: Floats, costs: SahCosts, how: Refinement, max_depth: int = MAX_DEPTH, told: Told = untold
) -> Bvh:
    """The BVH over m >= 1 triangle bounds, (m, 2, 3) float32, finite.

    Where planes cut a triangle's box it is in several leaves, each of which has a part of the box, and the parts cover
    it: `order` is longer than m then. Equal input gives equal bytes. Raises ValueError for no triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    deepest = min(max_depth, MAX_DEPTH)
    first = within(told, 0.0, 1.0 / (1 + len(how.rounds)))
    loose, refs = _split(boxes, deepest, how.split, first) if how.split > 0.0 else _swept(boxes, deepest, first)
    loose = optimised(loose, how.rounds, costs, deepest, within(told, 1.0 / (1 + len(how.rounds)), 1.0))
    return settled(loose, refs.triangle, refs.box.reshape(-1, 2, 3), costs)


def _split(boxes: Floats, max_depth: int, worth: float, told: Told) -> tuple[Loose, References]:
    near = spatial_order(boxes)
    return split_down(References(boxes.reshape(-1, 6)[near], near.view(np.int32)), max_depth, worth, told)


def _swept(boxes: Floats, max_depth: int, told: Told) -> tuple[Loose, References]:
    tree = build_bvh(boxes, SINGLES, max_depth=max_depth, told=told)
    return loosened(tree), References(boxes.reshape(-1, 6)[tree.order], tree.order)
