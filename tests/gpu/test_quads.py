"""What is packed of a wide BVH's children is what `quad_child` gives, and no face of theirs moves inward."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from test_round_trip import Words, bits, device_reads, shader

from renderer.build.tree import EMPTY, MAX_BVH_LEAF, WideBvh
from renderer.pack.grid import grid_over
from renderer.pack.nodes import PackError, pack_nodes
from renderer.pack.quads import FRAME_CELLS
from renderer.pack.schema import LEAF, NODE_LAYOUTS, glsl

NODES = 700
SEED = 97
ABSENT, INNER, SOME_LEAF = 0, 1, 2


def random_wide(seed: int, scale: float) -> WideBvh:
    """Nodes with every number and kind of children, in boxes of all sizes and places; they make no tree."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(INNER, SOME_LEAF + 1, (NODES, 4))
    kinds[np.arange(4) > rng.integers(0, 4, NODES)[:, None]] = ABSENT
    leaf, inner, absent = (kinds == kind for kind in (SOME_LEAF, INNER, ABSENT))
    count = np.where(leaf, rng.integers(1, MAX_BVH_LEAF + 1, kinds.shape), np.where(absent, EMPTY, 0))
    before = np.cumsum(np.where(leaf, count, 0), axis=1) - np.where(leaf, count, 0)
    slots = rng.integers(0, (1 << 24) - 4 * MAX_BVH_LEAF, NODES)[:, None] + before
    nodes = rng.integers(1, (1 << 24) - 4, NODES)[:, None] + np.cumsum(inner, axis=1) - inner
    size = scale * 2.0 ** rng.uniform(-30, 0, (NODES, 1, 1))
    centre = rng.uniform(-scale, scale, (NODES, 1, 3))
    faces = np.sort((centre + size * rng.uniform(-1, 1, (2, NODES, 4, 3))).astype(np.float32), axis=0)
    flat = rng.random((NODES, 4, 3)) < 0.1
    faces[1] = np.where(flat, faces[0], faces[1])
    lower = np.where(absent[:, :, None], np.inf, faces[0])
    upper = np.where(absent[:, :, None], -np.inf, faces[1])
    lower[0, 0], upper[0, 0] = lower.min(axis=(0, 1)), np.where(np.isinf(upper), -np.inf, upper).max(axis=(0, 1))
    return WideBvh(
        width=4,
        lower=lower.astype(np.float32),
        upper=upper.astype(np.float32),
        child=np.where(leaf, slots, np.where(inner, nodes, 0)).astype(np.int32),
        count=count.astype(np.int32),
        order=np.arange(9, dtype=np.int32),
        depth=1,
        waiting=3,
        cost=0.0,
    )


def found_children(tree: WideBvh, node_format: str) -> tuple[Words, Words, npt.NDArray[np.float32]]:
    """Of every child on the device: whether it is there, its link word, and its faces (n, 4, 2, 3)."""
    packed = pack_nodes(tree, "quad", node_format)
    nodes = "i" if node_format == "quant8" else "4u * i"
    statements = [f"fetch_quad({nodes});", "vec3 lower, upper;", "uint link;"]
    for child in range(4):
        statements.append(f"found[i * 32u + {child * 8}u] = uint(quad_child({child}, lower, upper, link));")
        statements.append(f"found[i * 32u + {child * 8 + 1}u] = link;")
        for k in range(6):
            face, axis = ("lower", "upper")[k // 3], "xyz"[k % 3]
            statements.append(f"found[i * 32u + {child * 8 + 2 + k}u] = floatBitsToUint({face}.{axis});")
    text = shader({}, [glsl("quad", node_format)], 1, statements)
    grid = {} if packed.grid is None else {"grid_origin": packed.grid.origin, "grid_cell": packed.grid.cell}
    words = device_reads(text, [packed.words], NODES, 32, grid).reshape(NODES, 4, 8)
    faces = np.ascontiguousarray(words[:, :, 2:]).view(np.float32).reshape(NODES, 4, 2, 3)
    return words[:, :, 0], words[:, :, 1], faces


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("node_format", NODE_LAYOUTS["quad"])
def test_every_child_is_read_back(node_format: str, scale: float) -> None:
    tree = random_wide(SEED, scale)
    there, link, faces = found_children(tree, node_format)
    np.testing.assert_array_equal(there != 0, tree.count != EMPTY)
    inner, leaf = tree.count == 0, tree.count > 0
    step = 1 if node_format == "quant8" else 4
    np.testing.assert_array_equal(link[inner], (tree.child[inner].astype(np.int64) * step) << 2 | 1)
    np.testing.assert_array_equal(link[leaf], tree.child[leaf].astype(np.int64) << 8 | tree.count[leaf] << 2 | LEAF)
    real = tree.count != EMPTY
    lower, upper = tree.lower[real], tree.upper[real]
    low, high = faces[real][:, 0], faces[real][:, 1]
    match node_format:
        case "f32":
            np.testing.assert_array_equal(bits(low), bits(lower))
            np.testing.assert_array_equal(bits(high), bits(upper))
            return
        case "half":
            with np.errstate(over="ignore"):
                np.testing.assert_array_equal(low, lower.astype(np.float16).astype(np.float32))
                np.testing.assert_array_equal(high, upper.astype(np.float16).astype(np.float32))
            return
        case "grid16":
            cell = np.broadcast_to(grid_over(lower.min(axis=0), upper.max(axis=0)).cell, low.shape)
        case "quant8":
            frames = grid_over(tree.lower.min(axis=1), tree.upper.max(axis=1), FRAME_CELLS)
            cell = np.broadcast_to(frames.cell[:, None], tree.lower.shape)[real]
        case other:
            raise AssertionError(f"the format {other} is not tested")
    assert (low <= lower).all()
    assert (high >= upper).all()
    assert (lower - low.astype(np.float64) < cell).all()
    assert (high.astype(np.float64) - upper <= cell).all()


def test_a_node_of_zeros_has_no_children() -> None:
    """Pixels that a draw does not cover read them."""
    for node_format, layout in NODE_LAYOUTS["quad"].items():
        words = np.zeros(4 * layout.words, np.uint32)
        statements = ["fetch_quad(0u);", "vec3 lower, upper;", "uint link, count = 0u;"]
        statements += [f"count += uint(quad_child({child}, lower, upper, link));" for child in range(4)]
        statements.append("found[i] = count;")
        grid = grid_over(np.zeros(3, np.float32), np.ones(3, np.float32))
        text = shader({}, [glsl("quad", node_format, grid)], 1, statements)
        assert device_reads(text, [words], 1, 1)[0, 0] == 0


def test_more_slots_than_24_bits_are_refused() -> None:
    tree = random_wide(SEED, 1.0)
    tree.child[tree.count > 0] = 1 << 24
    with pytest.raises(PackError, match=r"Node field slots needs 16777216, more than its 24 bits hold\."):
        pack_nodes(tree, "quad", "quant8")
