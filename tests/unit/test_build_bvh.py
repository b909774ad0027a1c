from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, Floats, soup

from renderer.build.bvh import BvhMethod, build_bvh
from renderer.build.make import bounds
from renderer.build.tree import MAX_BVH_LEAF, MAX_DEPTH, Bvh, SahCosts
from scenes.load import load
from scenes.places import find_named

COSTS = [SahCosts(), SahCosts(1.0, 1.0), SahCosts(0.0, 2.0), SahCosts(1.0, 0.0), SahCosts(1e6, 1.0)]


def areas(lower: Floats, upper: Floats) -> npt.NDArray[np.float64]:
    size = upper.astype(np.float64) - lower
    return 2 * (size[:, 0] * size[:, 1] + size[:, 1] * size[:, 2] + size[:, 2] * size[:, 0])


def ranges(tree: Bvh) -> npt.NDArray[np.int64]:
    """The slots [begin, end) of every node's triangles; fails unless siblings' ranges join."""
    found = np.zeros((len(tree.child), 2), np.int64)
    for node in reversed(range(len(tree.child))):
        child, count = int(tree.child[node]), int(tree.count[node])
        if count:
            found[node] = child, child + count
        else:
            assert found[child, 1] == found[child + 1, 0]
            found[node] = found[child, 0], found[child + 1, 1]
    return found


def check_links(tree: Bvh, number: int) -> None:
    nodes = len(tree.child)
    inner = np.flatnonzero(tree.count == 0)
    assert tree.parent[0] == -1
    assert sorted([0, *tree.child[inner], *(tree.child[inner] + 1)]) == list(range(nodes))
    assert (tree.child[inner] > inner).all()
    assert (tree.parent[tree.child[inner]] == inner).all()
    assert (tree.parent[tree.child[inner] + 1] == inner).all()
    leaves = np.flatnonzero(tree.count)
    slots = np.concatenate([np.arange(tree.child[i], tree.child[i] + tree.count[i]) for i in leaves])
    assert sorted(slots) == list(range(number))
    assert sorted(tree.order) == list(range(number))
    assert tree.count.max() <= MAX_BVH_LEAF
    depth = np.zeros(nodes, np.int64)
    for node in range(1, nodes):
        depth[node] = depth[tree.parent[node]] + 1
    assert tree.depth == depth.max() <= MAX_DEPTH


def check_boxes(tree: Bvh, boxes: Floats) -> None:
    sorted_boxes = boxes[tree.order]
    # float32, as the builder's sort keys are; from float64, so that the largest coordinates do not overflow
    centre = (0.5 * sorted_boxes.astype(np.float64).sum(axis=1)).astype(np.float32)
    for node, (begin, end) in enumerate(ranges(tree)):
        assert (tree.lower[node] == sorted_boxes[begin:end, 0].min(axis=0)).all()
        assert (tree.upper[node] == sorted_boxes[begin:end, 1].max(axis=0)).all()
        if tree.count[node] == 0:
            cut, axis = first_slot(tree, int(tree.child[node]) + 1), tree.axis[node]
            assert centre[begin:cut, axis].max() <= centre[cut:end, axis].min()


def first_slot(tree: Bvh, node: int) -> int:
    while tree.count[node] == 0:
        node = int(tree.child[node])
    return int(tree.child[node])


def check_cost(tree: Bvh, costs: SahCosts) -> None:
    area = areas(tree.lower, tree.upper)
    ratio = area / area[0] if area[0] > 0 else np.ones_like(area)
    node_costs = np.where(tree.count > 0, costs.intersection * tree.count, costs.traversal)
    assert tree.cost == pytest.approx((ratio * node_costs).sum(), rel=1e-9)


@pytest.mark.parametrize("method", ["sah", "binned", "median"])
@pytest.mark.parametrize("name", SOUPS)
def test_every_invariant_holds(name: str, method: BvhMethod) -> None:
    boxes = SOUPS[name]()
    for costs in COSTS:
        tree = build_bvh(boxes, costs, method)
        check_links(tree, len(boxes))
        check_boxes(tree, boxes)
        check_cost(tree, costs)


@pytest.mark.parametrize("name", SOUPS)
def test_equal_input_gives_equal_bytes(name: str) -> None:
    boxes = SOUPS[name]()
    first, second = build_bvh(boxes, SahCosts()), build_bvh(boxes.copy(), SahCosts())
    for field, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(second, field), err_msg=field)


@pytest.mark.parametrize("method", ["sah", "binned", "median"])
def test_threads_change_no_byte(method: BvhMethod, monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = soup(20000, 14)
    monkeypatch.setenv("RAYFARM_BUILD_THREADS", "1")
    monkeypatch.setattr("renderer.build.bvh.TASK", 30000)
    whole = build_bvh(boxes, SahCosts(), method)
    monkeypatch.setattr("renderer.build.bvh.TASK", 300)
    for threads in ("1", "2", "3"):
        monkeypatch.setenv("RAYFARM_BUILD_THREADS", threads)
        for field, value in vars(build_bvh(boxes, SahCosts(), method)).items():
            np.testing.assert_array_equal(value, getattr(whole, field), err_msg=field)


@pytest.mark.parametrize("seed", range(3))
def test_bins_cost_little_more_than_the_sweep(seed: int) -> None:
    boxes, costs = soup(20000, seed, size=0.02), SahCosts(1.0, 1.0)
    assert build_bvh(boxes, costs, "binned").cost < 1.04 * build_bvh(boxes, costs).cost


@pytest.mark.parametrize("seed", range(5))
def test_the_sweep_costs_no_more_than_the_median(seed: int) -> None:
    boxes = soup(2000, seed)
    costs = SahCosts(1.0, 1.0)
    assert build_bvh(boxes, costs).cost < build_bvh(boxes, costs, "median").cost


def cheapest_cut(boxes: Floats) -> float:
    """The least sum of area times count over both sides, over every cut of every axis's centroid order."""
    best = np.inf
    for axis in range(3):
        ordered = boxes[np.argsort(boxes[:, :, axis].sum(axis=1), kind="stable")]
        best = min(best, *(cut_cost(ordered[:cut], ordered[cut:]) for cut in range(1, len(ordered))))
    return best


def cut_cost(left: Floats, right: Floats) -> float:
    return sum(
        len(side) * float(areas(side[:, 0].min(axis=0)[None], side[:, 1].max(axis=0)[None])[0])
        for side in (left, right)
    )


@pytest.mark.parametrize("number", [2, 3, 4, 7, 20, 60])
@pytest.mark.parametrize("seed", range(8))
def test_the_root_is_cut_where_an_exhaustive_search_cuts_it(number: int, seed: int) -> None:
    boxes, costs = soup(number, seed, size=0.3), SahCosts()
    tree = build_bvh(boxes, costs)
    whole = float(areas(tree.lower[:1], tree.upper[:1])[0])
    best = cheapest_cut(boxes)
    split_pays = costs.traversal * whole + costs.intersection * best < costs.intersection * number * whole
    assert (tree.count[0] == 0) == split_pays
    if split_pays:
        cut = first_slot(tree, int(tree.child[0]) + 1)
        sorted_boxes = boxes[tree.order]
        assert cut_cost(sorted_boxes[:cut], sorted_boxes[cut:]) == pytest.approx(best, rel=1e-6)


def test_the_median_makes_leaves_of_four_at_most() -> None:
    assert build_bvh(soup(1000, 3), SahCosts(), "median").count.max() == 4


def test_duplicates_beyond_a_leaf_are_halved() -> None:
    tree = build_bvh(SOUPS["duplicates"](), SahCosts())
    assert set(tree.count[tree.count > 0]) == {62, 63}  # 1000 halved four times


@pytest.mark.parametrize("bound", [13, 16, 20, 26])
def test_the_depth_is_bounded_where_the_heuristic_would_go_deeper(bound: int) -> None:
    boxes = SOUPS["shrinking-copies"]()
    assert build_bvh(boxes, SahCosts()).depth > 26
    tree = build_bvh(boxes, SahCosts(), max_depth=bound)
    check_links(tree, len(boxes))
    assert tree.depth <= bound


# SAH costs with (1, 1) that tinybvh's full sweep reaches on the same files.
@pytest.mark.parametrize(("file", "cost"), [("crytek_sponza_262k.ply", 74.3), ("conference_331k.ply", 34.3)])
def test_real_scenes_cost_what_another_full_sweep_makes_of_them(file: str, cost: float) -> None:
    if find_named(file) is None:
        pytest.skip(f"{file} is in none of the folders of RAYFARM_SCENES")
    boxes = bounds(load(file).triangles)
    assert build_bvh(boxes, SahCosts(1.0, 1.0)).cost == pytest.approx(cost, rel=0.02)


def test_no_triangles_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one triangle"):
        build_bvh(np.zeros((0, 2, 3), np.float32), SahCosts())
