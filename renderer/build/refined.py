"""BVHs that cost less than a sweep's: with spatial splits, with re-insertion, or with both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build.loose import settled
from renderer.build.reinsert import reinserted
from renderer.build.sbvh import References, split_down
from renderer.build.tree import MAX_DEPTH, Bvh, Floats, SahCosts


@dataclass(frozen=True)
class Refinement:
    """How a tree is made: `growth` references at most that spatial splits add, per triangle; `rounds` of re-insertion,
    each of `share` of the nodes."""

    growth: float
    rounds: int
    share: float


REFINEMENTS = {
    "reinserted": Refinement(0.0, 20, 0.2),
    "sbvh": Refinement(1.0, 0, 0.0),
    "sbvh-reinserted": Refinement(1.0, 20, 0.2),
}
"""The builders of this file by their names."""


def build_refined(boxes: Floats, costs: SahCosts, how: Refinement) -> Bvh:
    """The BVH over m >= 1 triangle bounds (m, 2, 3) float32, finite, down to single references and cut off where
    leaves cost no more. `Bvh.order` names a triangle more than once where its box was split."""
    refs = References(np.ascontiguousarray(boxes).reshape(-1, 6), np.arange(len(boxes), dtype=np.int32))
    tree, held = split_down(refs, MAX_DEPTH, how.growth)
    tree = reinserted(tree, MAX_DEPTH, how.rounds, how.share)
    return settled(tree, held.triangle, held.box.reshape(-1, 2, 3), costs)
