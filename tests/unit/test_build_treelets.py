"""Treelets: where one holds the whole tree, no binary tree over its leaves costs less."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, soup

from renderer.build.bvh import build_bvh
from renderer.build.loose import loosened, settled
from renderer.build.tree import MAX_BVH_LEAF, SahCosts
from renderer.build.treelets import LEAVES, LEAVES_HIGH, regrouped

SINGLES = SahCosts(0.0, 1.0)
Floats = npt.NDArray[np.float32]


def least_cost(boxes: Floats, costs: SahCosts) -> float:
    """The SAH cost of the best tree over boxes (n, 2, 3), by trying all."""

    def area(chosen: frozenset[int]) -> float:
        own = boxes[sorted(chosen)].astype(np.float64)
        x, y, z = own[:, 1].max(axis=0) - own[:, 0].min(axis=0)
        return float(x * y + z * (x + y))

    @cache
    def least(chosen: frozenset[int]) -> float:
        leaf = area(chosen) * costs.intersection * len(chosen)
        if len(chosen) == 1:
            return leaf
        first, *others = sorted(chosen)
        parted = min(
            least(frozenset({first, *some})) + least(chosen - {first, *some})
            for size in range(len(others))
            for some in combinations(others, size)
        )
        return min(leaf, area(chosen) * costs.traversal + parted)

    whole = frozenset(range(len(boxes)))
    return least(whole) / area(whole)


@pytest.mark.parametrize("costs", [SahCosts(1.0, 1.0), SahCosts(3.0, 1.5), SahCosts(0.2, 1.0)], ids=str)
@pytest.mark.parametrize("count", [3, 5, LEAVES, LEAVES_HIGH])
@pytest.mark.parametrize("seed", range(3))
def test_no_tree_over_a_few_boxes_costs_less(seed: int, count: int, costs: SahCosts) -> None:
    boxes = soup(count, seed, size=0.4)
    start = build_bvh(boxes, SINGLES)
    assert (start.count <= 1).all()
    made = settled(regrouped(loosened(start), costs), start.order, boxes[start.order], costs)
    assert made.cost == pytest.approx(least_cost(boxes, costs), rel=1e-6)


@pytest.mark.parametrize("name", SOUPS)
def test_nothing_is_lost_and_nothing_costs_more(name: str) -> None:
    boxes = SOUPS[name]()
    costs = SahCosts(1.0, 1.0)
    start = build_bvh(boxes, SINGLES)
    before = settled(loosened(start), start.order, boxes[start.order], costs)
    after = settled(regrouped(loosened(start), costs), start.order, boxes[start.order], costs)
    assert sorted(after.order) == list(range(len(boxes)))
    assert after.count.max() <= MAX_BVH_LEAF
    assert after.cost <= before.cost * (1 + 1e-6)
