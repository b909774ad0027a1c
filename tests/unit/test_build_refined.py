"""Refined BVHs are trees over the right boxes: what is cut is covered, at less cost, the same on any cores."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, soup

from renderer.build.bvh import build_bvh
from renderer.build.refined import REFINEMENTS, build_refined
from renderer.build.tree import MAX_BVH_LEAF, MAX_DEPTH, Bvh, SahCosts

COSTS = SahCosts(1.0, 1.0)
NAMES = tuple(REFINEMENTS)
Floats = npt.NDArray[np.float32]


def check(tree: Bvh, boxes: Floats) -> None:
    leaf = tree.count > 0
    inner = np.flatnonzero(~leaf)
    assert (tree.child[inner] > inner).all()
    for side in (0, 1):
        np.testing.assert_array_equal(tree.parent[tree.child[inner] + side], inner)
        assert (tree.lower[inner] <= tree.lower[tree.child[inner] + side]).all()
        assert (tree.upper[inner] >= tree.upper[tree.child[inner] + side]).all()
    starts, counts = tree.child[leaf], tree.count[leaf]
    by_start = np.argsort(starts)
    np.testing.assert_array_equal(starts[by_start], np.concatenate([[0], np.cumsum(counts[by_start])[:-1]]))
    assert counts.sum() == len(tree.order)
    assert counts.max() <= MAX_BVH_LEAF
    assert tree.depth <= MAX_DEPTH
    assert set(tree.order.tolist()) == set(range(len(boxes)))
    for first, count in zip(starts, counts, strict=True):
        assert len(set(tree.order[first : first + count].tolist())) == count


def check_cover(tree: Bvh, boxes: Floats, rng: np.random.Generator) -> None:
    """Every point of a triangle's box lies in a leaf that names the triangle: the box's corners, and some within."""
    at = np.concatenate([np.array(list(np.ndindex(2, 2, 2)), np.float64), rng.random((24, 3))])
    points = boxes[:, None, 0].astype(np.float64) * (1 - at) + boxes[:, None, 1].astype(np.float64) * at
    points = np.clip(points.astype(np.float32), boxes[:, None, 0], boxes[:, None, 1])
    held = np.zeros(points.shape[:2], np.bool_)
    for node in np.flatnonzero(tree.count > 0):
        for triangle in tree.order[tree.child[node] : tree.child[node] + tree.count[node]]:
            inside = (points[triangle] >= tree.lower[node]) & (points[triangle] <= tree.upper[node])
            held[triangle] |= inside.all(axis=1)
    assert held.all()


@pytest.mark.parametrize("builder", NAMES)
@pytest.mark.parametrize("name", SOUPS)
def test_a_tree_holds_what_it_should(name: str, builder: str) -> None:
    boxes = SOUPS[name]()
    tree = build_refined(boxes, COSTS, REFINEMENTS[builder])
    check(tree, boxes)
    check_cover(tree, boxes, np.random.default_rng(7))


@pytest.mark.parametrize("seed", range(4))
def test_reinsertion_lowers_the_cost_and_large_triangles_are_split(seed: int) -> None:
    boxes = np.concatenate([soup(2000, seed), soup(60, seed + 10, size=1.0)])
    sweep = build_bvh(boxes, COSTS)
    made = {name: build_refined(boxes, COSTS, REFINEMENTS[name]) for name in NAMES}
    assert made["reinserted"].cost < sweep.cost
    assert made["sbvh-reinserted"].cost < made["sbvh"].cost
    assert len(made["reinserted"].order) == len(boxes) < len(made["sbvh"].order) <= 2 * len(boxes)


@pytest.mark.parametrize("builder", NAMES)
def test_cores_change_nothing(builder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = soup(40_000, 9)
    trees = []
    for threads in ("1", "2"):
        monkeypatch.setenv("RAYFARM_BUILD_THREADS", threads)
        trees.append(build_refined(boxes, COSTS, REFINEMENTS[builder]))
    for name, values in vars(trees[0]).items():
        np.testing.assert_array_equal(values, getattr(trees[1], name), err_msg=name)
