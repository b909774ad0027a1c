"""BVHs that cost less than a sweep's: with spatial splits, with re-insertion and treelets, and with clipped triangles.

Leaves are merged last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.build.bvh import build_bvh
from renderer.build.kd_clip import Shapes, shapes_of
from renderer.build.loose import Loose, loosened, reach_of, settled
from renderer.build.optimise import LONG, SHORT, Round, optimised, single
from renderer.build.parted import parted
from renderer.build.progress import Told, untold, within
from renderer.build.sbvh import References, split_down
from renderer.build.spatial import spatial_order
from renderer.build.tree import MAX_DEPTH, Bvh, Floats, SahCosts
from renderer.build.treelets import regrouped

SINGLES = SahCosts(0.0, 1.0)
"""With visits that cost nothing a full sweep goes down to single triangles, unless their boxes are the same."""


@dataclass(frozen=True)
class Refinement:
    """How a tree is made: planes in space are taken where they cost less than `split` of the best object split, so 0
    takes none; then `rounds` of what makes it better; and before each of `cuts` large triangles are cut and clipped."""

    split: float
    rounds: Sequence[Round]
    cuts: Sequence[Sequence[Round]] = ()


REFINEMENTS = {
    "reinserted": Refinement(0.0, SHORT),
    "sbvh": Refinement(1.0, ()),
    "sbvh-reinserted": Refinement(0.85, LONG),
    "clipped": Refinement(0.85, LONG, ((single,), (single, regrouped))),
}
"""The builders of this file by their names. Re-insertion itself wins what splits that win little would."""


def build_refined(
    boxes: Floats,
    costs: SahCosts,
    how: Refinement,
    max_depth: int = MAX_DEPTH,
    told: Told = untold,
    triangles: Floats | None = None,
) -> Bvh:
    """The BVH over m >= 1 triangle bounds, (m, 2, 3) float32, finite, and their `triangles` (m, 3, 3) if they are cut.

    Where planes cut a triangle's box it is in several leaves, each of which has a part of the box, and the parts cover
    it, or if triangles are clipped whatever of it is near the triangle: `order` is longer than m then. Equal input
    gives equal bytes. Raises ValueError for no triangles.
    """
    if len(boxes) == 0:
        raise ValueError("A tree needs at least one triangle; give a scene that has some.")
    deepest, work = min(max_depth, MAX_DEPTH), 1 + len(how.rounds) + 3 * len(how.cuts)
    first, last = 1.0 / work, (1.0 + len(how.rounds)) / work
    begun = within(told, 0.0, first)
    loose, refs = _split(boxes, deepest, how.split, begun) if how.split > 0.0 else _swept(boxes, deepest, begun)
    loose = optimised(loose, how.rounds, costs, deepest, within(told, first, last))
    if how.cuts:
        assert triangles is not None
        shapes = shapes_of(triangles, boxes)
        loose, refs = _cut(loose, refs, shapes, how.cuts, costs, deepest, within(told, last, 1.0))
    return settled(loose, refs.triangle, refs.box.reshape(-1, 2, 3), costs)


def _split(boxes: Floats, max_depth: int, worth: float, told: Told) -> tuple[Loose, References]:
    near = spatial_order(boxes)
    return split_down(References(boxes.reshape(-1, 6)[near], near.view(np.int32)), max_depth, worth, told)


def _swept(boxes: Floats, max_depth: int, told: Told) -> tuple[Loose, References]:
    tree = build_bvh(boxes, SINGLES, max_depth=max_depth, told=told)
    return loosened(tree), References(boxes.reshape(-1, 6)[tree.order], tree.order)


def _cut(
    tree: Loose,
    refs: References,
    shapes: Shapes,
    cuts: Sequence[Sequence[Round]],
    costs: SahCosts,
    max_depth: int,
    told: Told,
) -> tuple[Loose, References]:
    for number, rounds in enumerate(cuts):
        after, parts = parted(tree, refs, shapes, costs)
        if reach_of(after) <= max_depth:
            tree, refs = after, parts
        tree = optimised(tree, rounds, costs, max_depth, untold)
        told((number + 1) / len(cuts))
    return tree, refs
