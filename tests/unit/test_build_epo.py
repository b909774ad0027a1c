from __future__ import annotations

import numpy as np
import pytest

from renderer.build.api import build
from renderer.build.bvh import build_bvh
from renderer.build.epo import epo
from renderer.build.make import bounds
from renderer.build.refined import Refinement, build_refined
from renderer.build.tree import Bvh, Floats, SahCosts

COSTS = SahCosts(2.0, 3.0)


def triangles(number: int, seed: int, size: float = 0.3) -> Floats:
    rng = np.random.default_rng(seed)
    return (rng.random((number, 1, 3)) + size * rng.random((number, 3, 3))).astype(np.float32)


def brute(tree: Bvh, corners: Floats, seed: int, points: int) -> float:
    """The mean over as many points on each triangle, weighed by the triangles' areas, from the definition."""
    rng = np.random.default_rng(seed)
    below: list[set[int]] = [set() for _ in tree.child]
    for node in reversed(range(len(tree.child))):
        child, count = int(tree.child[node]), int(tree.count[node])
        below[node] = set(tree.order[child : child + count]) if count else below[child] | below[child + 1]
    node_costs = np.where(tree.count > 0, COSTS.intersection * tree.count, COSTS.traversal)
    exact = corners.astype(np.float64)
    area = np.linalg.norm(np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0]), axis=1)
    means = []
    for triangle, (a, b, c) in enumerate(exact):
        u, v = rng.random((2, points, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        at = np.clip(a + u * (b - a) + v * (c - a), np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c))
        holds = ((at[:, None] >= tree.lower) & (at[:, None] <= tree.upper)).all(axis=2)
        foreign = np.array([triangle not in inside for inside in below])
        means.append((holds * foreign * node_costs).sum(axis=1).mean())
    return float(np.average(means, weights=area))


@pytest.mark.parametrize("split", [0.0, 1.5])
@pytest.mark.parametrize("seed", range(4))
def test_the_estimate_is_what_the_definition_gives(seed: int, split: float) -> None:
    corners = triangles(60, seed)
    tree = build_refined(bounds(corners), COSTS, Refinement(split, ()))
    assert epo(tree, corners, COSTS) == pytest.approx(brute(tree, corners, seed, 2000), rel=0.05)


def flat_wall(side: int) -> Floats:
    """Two triangles a cell of a grid in the plane y = 0.1."""
    x, z = np.meshgrid(np.arange(side), np.arange(side))
    low = np.stack([x.ravel(), np.full(x.size, 0.1), z.ravel()], axis=1)[:, None]
    first = low + np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]])
    second = low + np.array([[1, 0, 0], [1, 0, 1], [0, 0, 1]])
    return np.concatenate([first, second]).astype(np.float32)


def test_boxes_that_only_touch_do_not_overlap_and_flat_ones_may() -> None:
    corners, costs = flat_wall(16), SahCosts(1.0, 1.0)
    tree = build_bvh(bounds(corners), SahCosts(0.0, 1.0))
    # A cell's two triangles have one box: a leaf of both, or two leaves over which each point of the other lies.
    assert epo(tree, corners, costs) in (pytest.approx(0.0), pytest.approx(1.0))


def test_a_single_leaf_overlaps_nothing() -> None:
    assert epo(build_bvh(bounds(triangles(3, 1)), SahCosts(1e6, 1.0)), triangles(3, 1), COSTS) == 0.0


def test_what_has_no_area_has_no_overlap() -> None:
    corners = np.repeat(triangles(50, 2)[:, :1], 3, axis=1)
    assert epo(build_bvh(bounds(corners), COSTS), corners, COSTS) == 0.0


def test_it_comes_with_every_tree_and_from_the_cache(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))
    corners = triangles(200, 3)
    first, again = (build("key", corners, "bvh")[0].epo for _ in range(2))
    assert first == again == epo(build_bvh(bounds(corners), SahCosts()), corners, SahCosts())
    assert build("key", corners, "kd")[0].epo == 0.0
