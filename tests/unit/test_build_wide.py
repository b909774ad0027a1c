from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, Floats, soup

from renderer.build.bvh import build_bvh
from renderer.build.tree import EMPTY, MAX_BVH_LEAF, Bvh, SahCosts, WideBvh
from renderer.build.wide import collapse

COSTS = [SahCosts(), SahCosts(1.0, 1.0), SahCosts(0.0, 2.0), SahCosts(1.0, 0.0), SahCosts(1e6, 1.0)]


def half_areas(tree: Bvh) -> list[float]:
    x, y, z = (tree.upper.astype(np.float64) - tree.lower).T
    whole = x[0] * y[0] + z[0] * (x[0] + y[0])
    return list((x * y + z * (x + y)) / whole) if whole > 0 else [1.0] * len(x)


def check(wide: WideBvh, boxes: Floats, costs: SahCosts) -> None:
    """Every child's box is that of the triangles below it, which lie in one range where the docstring says."""
    assert sorted(wide.order) == list(range(len(boxes)))
    depth, waiting = 0, 0
    ranges: dict[int, list[int]] = {}
    paths = {0: (0, 0)}
    for node in range(len(wide.child)):
        inner = wide.child[node][wide.count[node] == 0]
        assert (np.diff(inner) == 1).all()
        assert (inner > node).all()
        level, before = paths[node]
        places = int((wide.count[node] != EMPTY).sum())
        assert (wide.count[node, places:] == EMPTY).all()
        depth, waiting = max(depth, level), max(waiting, before + places - 1)
        paths |= {int(child): (level + 1, before + places - 1) for child in inner}
        leaves = wide.count[node] > 0
        assert (wide.child[node][leaves][1:] == (wide.child[node] + wide.count[node])[leaves][:-1]).all()
    assert len(paths) == len(wide.child)
    assert (wide.depth, wide.waiting) == (depth, waiting)
    for node in reversed(range(len(wide.child))):
        ranges[node] = []
        for place in np.flatnonzero(wide.count[node] != EMPTY):
            child, count = int(wide.child[node, place]), int(wide.count[node, place])
            held = list(wide.order[child : child + count]) if count else ranges[child]
            ranges[node] += held
            assert (wide.lower[node, place] == boxes[held, 0].min(axis=0)).all()
            assert (wide.upper[node, place] == boxes[held, 1].max(axis=0)).all()
    assert wide.cost == pytest.approx(cost_of(wide, costs), rel=1e-9)


def cost_of(wide: WideBvh, costs: SahCosts) -> float:
    used = wide.count != EMPTY
    lower = np.where(used[..., None], wide.lower, np.inf).min(axis=(0, 1)).astype(np.float64)
    upper = np.where(used[..., None], wide.upper, -np.inf).max(axis=(0, 1)).astype(np.float64)

    def half(size: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        area: npt.NDArray[np.float64] = size[..., 0] * size[..., 1] + size[..., 2] * (size[..., 0] + size[..., 1])
        return area

    whole = half(upper - lower)
    area = half(wide.upper[used].astype(np.float64) - wide.lower[used])
    ratio = area / whole if whole > 0 else np.ones_like(area)
    counts = wide.count[used]
    return costs.traversal + float((ratio * np.where(counts > 0, costs.intersection * counts, costs.traversal)).sum())


@pytest.mark.parametrize("width", [2, 3, 4, 8])
@pytest.mark.parametrize("name", [name for name in SOUPS if name != "shrinking-copies"])
def test_every_invariant_holds(name: str, width: int) -> None:
    boxes = SOUPS[name]()
    for costs in COSTS if len(boxes) < 1000 else COSTS[:1]:
        check(collapse(build_bvh(boxes, costs), costs, width), boxes, costs)


def least(tree: Bvh, costs: SahCosts, width: int, max_leaf: int) -> float:
    """The cost of the cheapest collapse, from every way to open a node's children one after the other."""
    area = half_areas(tree)

    @cache
    def size(node: int) -> int:
        return int(tree.count[node]) or sum(size(int(tree.child[node]) + side) for side in (0, 1))

    @cache
    def one(node: int) -> float:
        leaf = area[node] * costs.intersection * size(node)
        if tree.count[node]:
            return leaf
        below = (int(tree.child[node]), int(tree.child[node]) + 1)
        inner = area[node] * costs.traversal + forest(below)
        return min(leaf, inner) if size(node) <= max_leaf else inner

    @cache
    def forest(nodes: tuple[int, ...]) -> float:
        best = sum(one(node) for node in nodes)
        for at, node in enumerate(nodes):
            if len(nodes) < width and tree.count[node] == 0:
                below = (int(tree.child[node]), int(tree.child[node]) + 1)
                best = min(best, forest((*nodes[:at], *below, *nodes[at + 1 :])))
        return best

    leaf = costs.traversal + costs.intersection * size(0)
    if tree.count[0]:
        return leaf
    inner = costs.traversal + forest((1, 2))
    return min(leaf, inner) if size(0) <= max_leaf and leaf - costs.traversal <= inner else inner


@pytest.mark.parametrize("width", [2, 3, 4, 6])
@pytest.mark.parametrize("max_leaf", [1, 3, MAX_BVH_LEAF])
@pytest.mark.parametrize("seed", range(6))
def test_no_other_collapse_costs_less(seed: int, max_leaf: int, width: int) -> None:
    boxes = soup(14, seed, size=0.3)
    tree = build_bvh(boxes, SahCosts(0.1, 1.0))
    for costs in (SahCosts(1.0, 1.0), SahCosts(3.0, 1.0), SahCosts(0.2, 1.0)):
        wide = collapse(tree, costs, width, max_leaf)
        check(wide, boxes, costs)
        assert wide.count.max() <= max(max_leaf, tree.count.max())
        assert wide.cost == pytest.approx(least(tree, costs, width, max_leaf), rel=1e-9)


def test_equal_input_gives_equal_bytes() -> None:
    tree = build_bvh(SOUPS["soup-3000-seed4"](), SahCosts())
    first, second = collapse(tree, SahCosts()), collapse(tree, SahCosts())
    for field, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(second, field), err_msg=field)


def test_children_fill_a_wide_node() -> None:
    wide = collapse(build_bvh(soup(3000, 4), SahCosts(1.0, 1.0)), SahCosts(1.0, 1.0), 4)
    assert (wide.count != EMPTY).sum() / len(wide.count) > 3.0


@pytest.mark.parametrize("width", [1, 9])
def test_another_width_is_refused(width: int) -> None:
    with pytest.raises(ValueError, match="take a width of 2 to 8"):
        collapse(build_bvh(soup(5, 1), SahCosts()), SahCosts(), width)
