"""Buffers: what does not fit is refused, sizes are the paper's, and normals survive their 32 bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from renderer.build import parallel
from renderer.build.bvh import build_bvh
from renderer.build.tree import Bvh, Kd, SahCosts
from renderer.pack.grid import grid_over
from renderer.pack.nodes import PackError, pack_nodes
from renderer.pack.paths import path_table
from renderer.pack.primitives import Corners, face_normals, octahedral, pack_primitives, pack_raster
from renderer.pack.schema import NODE_LAYOUTS, NodeLayout

RNG = np.random.default_rng(61)
TRIANGLES = RNG.random((50, 3, 3)).astype(np.float32)
NORMALS = RNG.standard_normal((50, 3, 3)).astype(np.float32)


def corners(values: npt.NDArray[np.float32]) -> Corners:
    return Corners(values.reshape(-1, 3), np.arange(3 * len(values), dtype=np.int32).reshape(-1, 3))


def bvh() -> Bvh:
    return build_bvh(np.stack([TRIANGLES.min(axis=1), TRIANGLES.max(axis=1)], axis=1), SahCosts())


def leaf_kd(count: int) -> Kd:
    zeros, ints = np.zeros((1, 3), np.float32), np.zeros(1, np.int32)
    return Kd(
        lower=zeros,
        upper=zeros + 1,
        split=np.zeros(1, np.float32),
        axis=np.full(1, 3, np.uint8),
        child=ints,
        count=ints + np.int32(count),
        parent=ints - np.int32(1),
        refs=np.arange(count, dtype=np.int32),
        depth=0,
        cost=0.0,
    )


@pytest.mark.parametrize(
    "layout",
    [
        pytest.param(layout, id=f"{name}-{node_format}")
        for name, formats in NODE_LAYOUTS.items()
        for node_format, layout in formats.items()
    ],
)
def test_fields_share_no_bits(layout: NodeLayout) -> None:
    for owner in ("inner", "leaf"):
        used = np.zeros(layout.words + 1, np.uint64)  # the last is the tail's
        for field in (one for one in layout.fields if one.owner in ("all", owner)):
            mask = np.uint64(((1 << field.bits) - 1) << field.shift)
            assert int(mask) < 1 << 32
            for word in range(field.word, field.word + (1 if field.kind in ("uint", "float") else 3)):
                assert used[word] & mask == 0, field.name
                used[word] |= mask
            assert field.kind in ("uint", "float") or field.word % layout.vector <= layout.vector - 3


@pytest.mark.parametrize(
    ("name", "node_format", "node_bytes"),
    [
        ("box", "f32", 32),
        ("box-parent", "f32", 32),
        ("box", "grid16", 16),
        ("box", "half", 16),
        ("box-parent", "half", 20),
    ],
)
def test_a_bvh_takes_its_nodes_and_the_unused_one(name: str, node_format: str, node_bytes: int) -> None:
    nbytes = (len(bvh().count) + 1) * node_bytes
    assert pack_nodes(bvh(), name, node_format).words.nbytes == -(-nbytes // 16) * 16


@pytest.mark.parametrize("node_format", NODE_LAYOUTS["box-path"])
def test_a_table_of_paths_follows_the_nodes(node_format: str) -> None:
    tree = bvh()
    plain, followed = (pack_nodes(tree, name, node_format) for name in ("box", "box-path"))
    assert followed.tail_at == len(plain.words) // 4
    nodes, table = np.split(followed.words, [len(plain.words)])
    np.testing.assert_array_equal(nodes, plain.words)
    links = plain.words.reshape(-1, 4 if node_format != "f32" else 8)[:, 3][
        np.append(0, np.arange(2, len(tree.count) + 1))
    ]
    given = path_table(tree.child, tree.count, links)
    np.testing.assert_array_equal(table[: len(given)], given)


GRID_CASES = {
    "unit": ([0, 0, 0], [1, 1, 1]),
    "far": ([1e6, -1e6, 123456.7], [1e6 + 1, 1 - 1e6, 123456.8]),
    "flat": ([0.1, -0.1, 0], [0.1, -0.1, 0]),
    "tiny": ([1e-38, -1e-40, 3e-39], [2e-38, 1e-40, 3e-39]),
    "huge": ([-1.5e38, 1e30, 0], [1.5e38, 3e38, 3e38]),
    "unequal": ([-1, -1e6, -1e-6], [1e5, 1e6, 1e6]),
}


@pytest.mark.parametrize("name", GRID_CASES)
def test_a_grid_is_exact_in_float32_and_holds_its_box(name: str) -> None:
    lower, upper = (np.array(corner, np.float32) for corner in GRID_CASES[name])
    grid = grid_over(lower, upper)
    rng = np.random.default_rng(63)
    points = (lower + rng.random((999, 3)) * (upper.astype(np.float64) - lower)).astype(np.float32)
    points = np.clip(np.concatenate([points, [lower, upper]]), lower, upper).astype(np.float32)
    low, high = grid.outward(points, points)
    for cells, below in ((low, True), (high, False)):
        assert cells.max() < 1 << 16
        exact = grid.origin + cells * grid.cell
        products = cells.astype(np.float32) * grid.cell.astype(np.float32)
        np.testing.assert_array_equal(grid.origin.astype(np.float32) + products, exact)
        off = points - exact if below else exact - points
        assert (off >= 0).all()
        assert (off < grid.cell).all()
    spread = np.maximum((upper.astype(np.float64) - lower) / 32766, np.abs([lower, upper]).max(axis=0) / 2.0**23)
    assert (grid.cell <= np.maximum(spread, 2.0**-126)).all()


def test_a_grid_beyond_float32_is_refused() -> None:
    tree = bvh()
    lower, upper = tree.lower.copy(), tree.upper.copy()
    lower[0], upper[0] = -np.finfo(np.float32).max, np.finfo(np.float32).max
    with pytest.raises(PackError, match="take the node format f32"):
        pack_nodes(replace(tree, lower=lower, upper=upper), "box", "grid16")


@pytest.mark.parametrize(("name", "node_bytes", "chunk"), [("plane", 8, 8), ("plane-box", 48, 16)])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5])
def test_a_kd_tree_takes_its_nodes_and_its_list(name: str, node_bytes: int, chunk: int, count: int) -> None:
    packed = pack_nodes(leaf_kd(count), name)
    list_bytes = -(-4 * count // chunk) * chunk
    assert packed.words.nbytes == 2 * node_bytes + list_bytes
    assert packed.tail_at is not None
    assert packed.tail_at * chunk == 2 * node_bytes
    np.testing.assert_array_equal(packed.words[2 * node_bytes // 4 :][:count], np.arange(count))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"count": 64}, "Node field count needs 64, more than its 6 bits hold."),
        ({"child": 1 << 24}, "Node field first needs 16777216, more than its 24 bits hold."),
    ],
    ids=["count", "first"],
)
def test_a_leaf_that_does_not_fit_is_refused(change: dict[str, int], sentence: str) -> None:
    tree = bvh()
    leaf = int(np.flatnonzero(tree.count > 0)[0])
    values = {name: getattr(tree, name).copy() for name in change}
    for name, value in change.items():
        values[name][leaf] = value
    with pytest.raises(PackError) as raised:
        pack_nodes(replace(tree, **values), "box")
    assert str(raised.value) == sentence


@pytest.mark.parametrize(("layout", "vec4s"), [("normal", 6), ("compact", 5), ("split", 6)])
def test_a_triangle_takes_what_the_paper_says(layout: str, vec4s: int) -> None:
    packed = pack_primitives(corners(TRIANGLES), corners(NORMALS), None, layout)
    assert packed.nbytes == len(TRIANGLES) * vec4s * 16
    assert (packed.normals is not None) == (layout == "split")


@pytest.mark.parametrize("layout", ["normal", "compact", "split"])
def test_blocks_of_triangles_change_nothing(layout: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = pack_primitives(corners(TRIANGLES), corners(NORMALS), None, layout)
    monkeypatch.setattr(parallel, "_BLOCK", 7)
    cut = pack_primitives(corners(TRIANGLES), corners(NORMALS), None, layout)
    np.testing.assert_array_equal(cut.vertices, whole.vertices)
    if whole.normals is not None:
        np.testing.assert_array_equal(cut.normals, whole.normals)


@pytest.mark.parametrize("name", ["box", "skip-octants", "skip-wide"])
def test_blocks_of_boxes_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = pack_nodes(bvh(), name, "grid16")
    monkeypatch.setattr(parallel, "_BLOCK", 7)
    np.testing.assert_array_equal(pack_nodes(bvh(), name, "grid16").words, whole.words)


@pytest.mark.parametrize("layout", ["normal", "compact", "split"])
def test_without_normals_every_layout_is_the_same(layout: str) -> None:
    packed = pack_primitives(corners(TRIANGLES), None, np.arange(50, dtype=np.int32)[::-1], layout)
    assert packed.normals is None
    words = packed.vertices.reshape(50, 3, 4)
    np.testing.assert_array_equal(words[:, :, :3].view(np.float32), TRIANGLES[::-1])
    np.testing.assert_array_equal(words[:, 0, 3], np.arange(50)[::-1])


def decoded(
    codes: np.ndarray[tuple[int, ...], np.dtype[np.uint32]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """As `shaders/common_octahedral.glsl` does, in float64."""
    halves = np.stack([codes & 0xFFFF, codes >> 16], axis=1).astype(np.uint16).view(np.int16)
    p = np.maximum(halves / 32767.0, -1.0)
    n = np.column_stack([p, 1 - np.abs(p).sum(axis=1)])
    fold = np.maximum(-n[:, 2:], 0.0)
    n[:, :2] += np.where(n[:, :2] >= 0, -fold, fold)
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def test_octahedral_normals_are_good_to_a_ten_thousandth() -> None:
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    random = np.random.default_rng(62).standard_normal((5000, 3))
    flat = random * [1, 1, 0]
    normals = np.concatenate([axes, random, flat])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.abs(decoded(octahedral(normals)) - normals).max() < 1e-4
    np.testing.assert_allclose(decoded(octahedral(axes)), axes, atol=1e-12)


def test_face_normals_are_unit_and_a_degenerate_s_is_z() -> None:
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 0, 3]], [[1, 1, 1], [1, 1, 1], [2, 2, 2]]], np.float32)
    np.testing.assert_array_equal(face_normals(corners), [[0, -1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    "normals", [None, NORMALS / np.linalg.norm(NORMALS, axis=2, keepdims=True)], ids=["flat", "smooth"]
)
def test_the_rasteriser_s_corners(normals: np.ndarray[tuple[int, ...], np.dtype[np.float32]] | None) -> None:
    words = pack_raster(TRIANGLES, normals).reshape(50, 3, 4)
    np.testing.assert_array_equal(words[:, :, :3].view(np.float32), TRIANGLES)
    given = np.repeat(face_normals(TRIANGLES)[:, None], 3, axis=1) if normals is None else normals
    assert np.abs(decoded(words[:, :, 3].ravel()) - given.reshape(-1, 3)).max() < 1e-4
