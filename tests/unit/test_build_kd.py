from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, Floats, lattice, soup

from renderer.build.kd import build_kd
from renderer.build.kd_clip import shapes_of
from renderer.build.make import bounds
from renderer.build.pad import pad_of, padded
from renderer.build.tree import KD_LEAF, MAX_DEPTH, Kd, SahCosts

COSTS = [SahCosts(), SahCosts(1.0, 1.0), SahCosts(0.0, 2.0), SahCosts(1.0, 0.0), SahCosts(1e6, 1.0)]
SMALL = [name for name in SOUPS if name != "shrinking-copies"]
BONUS = 0.8


def area(lower: Floats, upper: Floats) -> npt.NDArray[np.float64]:
    size = upper.astype(np.float64) - lower
    return 2 * (size[..., 0] * size[..., 1] + size[..., 1] * size[..., 2] + size[..., 2] * size[..., 0])


def check_links(tree: Kd) -> None:
    nodes = len(tree.child)
    inner = np.flatnonzero(tree.axis != KD_LEAF)
    assert tree.parent[0] == -1
    assert sorted([0, *tree.child[inner], *(tree.child[inner] + 1)]) == list(range(nodes))
    assert (tree.child[inner] > inner).all()
    assert (tree.parent[tree.child[inner]] == inner).all()
    assert (tree.parent[tree.child[inner] + 1] == inner).all()
    assert (tree.count[inner] == 0).all()
    depth = np.zeros(nodes, np.int64)
    for node in range(1, nodes):
        depth[node] = depth[tree.parent[node]] + 1
    assert tree.depth == depth.max() <= MAX_DEPTH


def check_cells(tree: Kd, boxes: Floats) -> None:
    """Children fill their parent and are as wide as nothing is not: together the leaves cover the root."""
    assert (tree.lower[0] == boxes[:, 0].min(axis=0)).all()
    assert (tree.upper[0] == boxes[:, 1].max(axis=0)).all()
    for node in np.flatnonzero(tree.axis != KD_LEAF):
        axis, plane, left = tree.axis[node], tree.split[node], tree.child[node]
        assert tree.lower[node, axis] < plane < tree.upper[node, axis]
        upper, lower = tree.upper[node].copy(), tree.lower[node].copy()
        upper[axis] = lower[axis] = plane
        assert (tree.lower[left] == tree.lower[node]).all()
        assert (tree.upper[left] == upper).all()
        assert (tree.lower[left + 1] == lower).all()
        assert (tree.upper[left + 1] == tree.upper[node]).all()


def check_refs(tree: Kd, boxes: Floats) -> None:
    """Every leaf holds each triangle that it must, and none that does not touch it; ids ascend."""
    leaves = np.flatnonzero(tree.axis == KD_LEAF)
    tiled = leaves[np.lexsort((tree.count[leaves], tree.child[leaves]))]
    assert (tree.child[tiled] == np.cumsum([0, *tree.count[tiled]])[:-1]).all()
    assert tree.count[leaves].sum() == len(tree.refs)
    assert set(tree.refs) == set(range(len(boxes)))
    low, high = boxes[:, 0], boxes[:, 1]
    for leaf in leaves:
        held = tree.refs[tree.child[leaf] : tree.child[leaf] + tree.count[leaf]]
        assert (np.diff(held) > 0).all()
        lower, upper = tree.lower[leaf], tree.upper[leaf]
        touching = ((low <= upper) & (high >= lower)).all(axis=1)
        # A solid box must overlap the cell's inside; one that is flat may lie in a face, on either side of it.
        inside = ((low < upper) & (high > lower)) | ((lower == upper) & touching[:, np.newaxis])
        flat_outside = (low != high) & ~inside
        assert touching[held].all()
        assert not flat_outside[held].any()
        assert np.isin(np.flatnonzero(inside.all(axis=1)), held).all()


def check_cost(tree: Kd, costs: SahCosts) -> None:
    areas = area(tree.lower, tree.upper)
    ratio = areas / areas[0] if areas[0] > 0 else np.ones_like(areas)
    node_costs = np.where(tree.axis == KD_LEAF, costs.intersection * tree.count, costs.traversal)
    assert tree.cost == pytest.approx((ratio * node_costs).sum(), rel=1e-9)


@pytest.mark.parametrize("pad", [False, True], ids=["exact", "padded"])
@pytest.mark.parametrize("name", SMALL)
def test_every_invariant_holds(name: str, pad: bool) -> None:
    boxes = padded(SOUPS[name]()) if pad else SOUPS[name]()
    for costs in COSTS if len(boxes) < 1000 else COSTS[:2]:
        tree = build_kd(boxes, costs)
        check_links(tree)
        check_cells(tree, boxes)
        check_refs(tree, boxes)
        check_cost(tree, costs)


@pytest.mark.parametrize("name", SOUPS)
def test_equal_input_gives_equal_bytes(name: str) -> None:
    boxes = SOUPS[name]()
    first, second = build_kd(boxes, SahCosts()), build_kd(boxes.copy(), SahCosts())
    for field, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(second, field), err_msg=field)


def price(boxes: Floats, axis: int, plane: np.float32, flat_left: bool, costs: SahCosts) -> float:
    """The cost of a split of the boxes' union, straight from its definition."""
    low, high = boxes[:, 0, axis], boxes[:, 1, axis]
    in_plane = (low == plane) & (high == plane)
    left = (low < plane) | (in_plane & flat_left)
    right = (high > plane) | (in_plane & (not flat_left))
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    left_upper, right_lower = upper.copy(), lower.copy()
    left_upper[axis] = right_lower[axis] = plane
    work = left.sum() * area(lower, left_upper) + right.sum() * area(right_lower, upper)
    cost = costs.traversal + costs.intersection * float(work / area(lower, upper))
    return cost * BONUS if not left.any() or not right.any() else cost


def cheapest(boxes: Floats, costs: SahCosts) -> float:
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    return min(
        (
            price(boxes, axis, plane, flat_left, costs)
            for axis in range(3)
            for plane in np.unique(boxes[:, :, axis])
            if lower[axis] < plane < upper[axis]
            for flat_left in (False, True)
        ),
        default=np.inf,
    )


def small_scene(kind: str, seed: int) -> Floats:
    number = 5 + 4 * seed
    if kind == "lattice":
        return lattice(number, seed)
    if kind == "sparse":
        return np.concatenate([soup(number, seed, size=0.01), soup(2, seed, size=0.01) + np.float32(3)])
    return soup(number, seed, size=2.0 if kind == "large" else 0.2)


@pytest.mark.parametrize("kind", ["soup", "large", "lattice", "sparse"])
@pytest.mark.parametrize("seed", range(12))
def test_the_root_is_cut_where_an_exhaustive_search_cuts_it(kind: str, seed: int) -> None:
    boxes = small_scene(kind, seed)
    costs = SahCosts(1.0, 1.0)
    tree, best = build_kd(boxes, costs), cheapest(boxes, costs)
    split_pays = best < costs.intersection * len(boxes)
    assert (tree.axis[0] != KD_LEAF) == split_pays
    if split_pays:
        axis, plane = int(tree.axis[0]), tree.split[0]
        flat_left = not in_right_only(tree, boxes, axis, plane)
        assert price(boxes, axis, plane, flat_left, costs) == pytest.approx(best, rel=1e-12)


def in_right_only(tree: Kd, boxes: Floats, axis: int, plane: np.float32) -> bool:
    """Whether the triangles that lie in the root's plane went to its right child."""
    flat = np.flatnonzero((boxes[:, :, axis] == plane).all(axis=1))
    return bool(np.isin(flat, refs_below(tree, int(tree.child[0]) + 1)).any())


def refs_below(tree: Kd, node: int) -> list[int]:
    if tree.axis[node] == KD_LEAF:
        return list(tree.refs[tree.child[node] : tree.child[node] + tree.count[node]])
    return [ref for child in (0, 1) for ref in refs_below(tree, int(tree.child[node]) + child)]


def test_empty_space_is_cut_off() -> None:
    boxes = np.concatenate([soup(200, 1, size=0.01), soup(200, 2, size=0.01) + np.float32(10)])
    tree = build_kd(boxes, SahCosts())
    empty = (tree.axis == KD_LEAF) & (tree.count == 0)
    assert area(tree.lower[empty], tree.upper[empty]).sum() > area(tree.lower[0], tree.upper[0])


@pytest.mark.parametrize("bound", [0, 1, 7, 12])
def test_the_depth_is_bounded_where_the_heuristic_would_go_deeper(bound: int) -> None:
    boxes = soup(3000, 4)
    assert build_kd(boxes, SahCosts(1.0, 1.0)).depth > 12
    tree = build_kd(boxes, SahCosts(1.0, 1.0), max_depth=bound)
    check_links(tree)
    check_refs(tree, boxes)
    assert tree.depth == bound


@pytest.mark.parametrize("name", SOUPS)
def test_padding_is_outward_and_never_less_than_asked(name: str) -> None:
    boxes = SOUPS[name]().astype(np.float64)
    wide = padded(SOUPS[name]()).astype(np.float64)
    asked = pad_of(SOUPS[name]())
    assert (boxes[:, 0] - wide[:, 0] >= asked).all()
    assert (wide[:, 1] - boxes[:, 1] >= asked).all()
    assert (wide[:, 0] < wide[:, 1]).all()
    assert (wide[:, 1] - boxes[:, 1] <= asked + 2.0**-22 * np.abs(boxes).max() + 1e-37).all()


@pytest.mark.parametrize("name", SMALL)
def test_no_cell_of_a_padded_tree_is_flat(name: str) -> None:
    boxes = SOUPS[name]()
    tree = build_kd(padded(boxes), SahCosts())
    assert (tree.upper > tree.lower).all()


def triangles(name: str, seed: int) -> Floats:
    """Triangles (m, 3, 3): "long" ones across half the scene, "slivers", "small" ones, or some "in planes"."""
    rng = np.random.default_rng(seed)
    number = 300
    if name == "long":
        from_one, along = rng.random((number, 1, 3)), rng.random((number, 2, 3)) * [1.0, 0.1, 0.1]
        return np.concatenate([from_one, from_one + along], axis=1).astype(np.float32)
    if name == "in planes":
        whole = rng.integers(0, 40, (number, 1, 3)) + rng.integers(-4, 5, (number, 3, 3))
        whole[::2, :, 1] = whole[::2, :1, 1]
        return whole.astype(np.float32)
    corners = rng.random((number, 1, 3)) + 0.2 * rng.random((number, 3, 3))
    if name == "slivers":
        corners[:, 2] = corners[:, 0] + (corners[:, 1] - corners[:, 0]) * (1.0 + 1e-6 * rng.random((number, 3)))
    return (corners * 1000.0).astype(np.float32)


def lists_where(tree: Kd, point: npt.NDArray[np.float64]) -> list[int]:
    """The triangles of a leaf whose cell holds a point."""
    node = 0
    while tree.axis[node] != KD_LEAF:
        node = int(tree.child[node]) + int(point[tree.axis[node]] > tree.split[node])
    return list(tree.refs[tree.child[node] : tree.child[node] + tree.count[node]])


@pytest.mark.parametrize("name", ["small", "long", "slivers", "in planes"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_clipped_triangle_is_listed_wherever_it_is_within_the_margin(name: str, seed: int) -> None:
    corners = triangles(name, seed)
    boxes = padded(bounds(corners))
    shapes = shapes_of(corners, boxes)
    tree, whole = build_kd(boxes, SahCosts(1.0, 1.0), shapes=shapes), build_kd(boxes, SahCosts(1.0, 1.0))
    check_links(tree)
    check_cells(tree, boxes)
    check_cost(tree, SahCosts(1.0, 1.0))
    assert tree.cost < whole.cost
    rng = np.random.default_rng(seed)
    for one in range(len(corners)):
        for weights in rng.dirichlet([0.5, 0.5, 0.5], 20):
            near = weights @ corners[one].astype(np.float64) + shapes.margin * rng.uniform(-0.99, 0.99, 3)
            # Strictly inside: faces are planes, and what is on a plane is in one of its two cells.
            inside = np.clip(near, boxes[one, 0] + 0.001 * shapes.margin, boxes[one, 1] - 0.001 * shapes.margin)
            assert one in lists_where(tree, inside), f"seed {seed}, {near}"


def test_a_clipped_leaf_lists_what_its_grown_cell_holds_and_no_more() -> None:
    """In the plane of one triangle, against the exact distance from its edge."""
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0.9, 0.9, 0], [1, 0.9, 0], [0.9, 1, 0.01]]], np.float32)
    boxes = padded(bounds(corners))
    tree = build_kd(boxes, SahCosts(0.01, 1.0), shapes=shapes_of(corners, boxes))
    assert 0 not in lists_where(tree, np.array([0.95, 0.95, 0.0]))
    assert 0 in lists_where(tree, np.array([0.5, 0.5, 0.0]))


@pytest.mark.parametrize("clip", [False, True])
def test_cores_change_nothing(clip: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.build.kd.TASK", 40)
    corners = triangles("small", 3)
    boxes = padded(bounds(corners))
    trees = []
    for threads in ("1", "2"):
        monkeypatch.setenv("RAYFARM_BUILD_THREADS", threads)
        trees.append(build_kd(boxes, SahCosts(1.0, 1.0), shapes=shapes_of(corners, boxes) if clip else None))
    for field, value in vars(trees[0]).items():
        np.testing.assert_array_equal(value, getattr(trees[1], field), err_msg=field)
    check_links(trees[0])
    check_cells(trees[0], boxes)
    if not clip:
        check_refs(trees[0], boxes)
    monkeypatch.setattr("renderer.build.kd.TASK", 0)
    alone = build_kd(boxes, SahCosts(1.0, 1.0), shapes=shapes_of(corners, boxes) if clip else None)
    assert alone.cost == pytest.approx(trees[0].cost, rel=1e-9)
    assert len(alone.refs) == len(trees[0].refs)


def test_no_triangles_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one triangle"):
        build_kd(np.zeros((0, 2, 3), np.float32), SahCosts())
