"""What is left of a tree without the boxes that are not worth their test: every triangle once, at the least cost."""

from __future__ import annotations

from collections import Counter
from functools import cache
from itertools import product

import numpy as np
import pytest
from build_soups import SOUPS, Floats, soup

from renderer.build.bvh import build_bvh
from renderer.build.pruned import MOST, Flags, pruned
from renderer.build.tree import Bvh, SahCosts

TRIANGLE, SPREAD = 2.0, 1.5
WIDTHS = (2, 3, 8)


def weights(tree: Bvh) -> list[float]:
    """The surface of each box, grown as the docstring says."""

    def half(x: float, y: float, z: float) -> float:
        return x * y + y * z + z * x

    sizes = tree.upper.astype(np.float64) - tree.lower
    leaf = float(np.median([half(*size) for size in sizes[tree.count > 0]]))
    grown = [half(*(size + SPREAD * (leaf / 3) ** 0.5)) for size in sizes]
    return grown if grown[0] > 0 else [1.0] * len(grown)


def reached(tree: Bvh, tested: Flags) -> list[tuple[int, int]]:
    """Every tested node with the nearest tested one above it, -1 for the root, as a walk reaches them."""
    found, waiting = [], [(0, -1)]
    while waiting:
        node, above = waiting.pop()
        if tested[node]:
            found.append((node, above))
            above = node
        if tree.count[node] == 0:
            waiting += [(int(tree.child[node]) + side, above) for side in (0, 1)]
    return found


def cost(tree: Bvh, tested: Flags, weight: list[float]) -> float:
    """Tests of boxes and triangles, but for the root's."""
    tests = sum(weight[above] for _, above in reached(tree, tested) if above >= 0)
    leaves = [node for node, _ in reached(tree, tested) if tree.count[node]]
    return tests + sum(TRIANGLE * weight[node] * int(tree.count[node]) for node in leaves)


def check(tree: Bvh, boxes: Floats, width: int) -> tuple[Bvh, Flags]:
    left, tested = pruned(tree, width, TRIANGLE, SPREAD)
    nodes, above = zip(*reached(left, tested), strict=True)
    assert tested[0]
    assert set(Counter(above).values()) <= set(range(1, width + 1))
    assert sorted(nodes) == list(np.flatnonzero(tested))
    slots: list[int] = []
    for node in sorted(nodes, key=lambda node: int(left.child[node])):
        first, count = int(left.child[node]), int(left.count[node])
        slots += range(first, first + count)
        held = boxes[tree.order[first : first + count]]
        if count:
            assert (left.lower[node] == held[:, 0].min(axis=0)).all()
            assert (left.upper[node] == held[:, 1].max(axis=0)).all()
            assert count <= MOST or count == tree.count[node]
    assert slots == list(range(len(tree.order)))
    return left, tested


@pytest.mark.parametrize("name", [name for name in SOUPS if name != "shrinking-copies"])
@pytest.mark.parametrize("width", WIDTHS)
def test_every_triangle_stays_in_one_leaf(name: str, width: int) -> None:
    boxes = SOUPS[name]()
    check(build_bvh(boxes, SahCosts(1.0, 1.0)), boxes, width)


def least(tree: Bvh, weight: list[float], width: int) -> float:
    """The cost of the best of all trees that are left when nodes are not tested and leaves are merged."""

    @cache
    def size(node: int) -> int:
        return int(tree.count[node]) or sum(size(int(tree.child[node]) + side) for side in (0, 1))

    @cache
    def ways(node: int) -> frozenset[tuple[int, float]]:
        """Every number of tests that the node's parent may have instead of its own, and what is spent below them."""
        own = TRIANGLE * weight[node] * size(node)
        if tree.count[node]:
            return frozenset({(1, own)})
        pairs = product(ways(int(tree.child[node])), ways(int(tree.child[node]) + 1))
        open_ = {(a + b, below + beside) for (a, below), (b, beside) in pairs if a + b <= width}
        kept = {(1, weight[node] * number + spent) for number, spent in open_}
        return frozenset(open_ | kept | ({(1, own)} if size(node) <= MOST else set()))

    return min(spent for number, spent in ways(0) if number == 1)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("size", [0.05, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_nothing_else_costs_less(seed: int, size: float, width: int) -> None:
    boxes = soup(9, seed, size)
    tree = build_bvh(boxes, SahCosts(0.1, 1.0))
    left, tested = check(tree, boxes, width)
    weight = weights(tree)
    assert cost(left, tested, weight) == pytest.approx(least(tree, weight, width), rel=1e-9)


def test_more_is_left_out_where_nodes_may_be_wide() -> None:
    boxes = SOUPS["soup-3000-seed4"]()
    tree = build_bvh(boxes, SahCosts(1.0, 1.0))
    weight = weights(tree)
    costs = [cost(tree, np.ones(len(tree.count), np.bool_), weight)]
    costs += [cost(*check(tree, boxes, width), weight) for width in WIDTHS]
    print(costs)
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.95 * costs[0]
