"""Depth-first nodes: a walk by links alone visits what a recursion visits, in each octant near children first."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.build.bvh import build_bvh
from renderer.build.pruned import pruned
from renderer.build.tree import Bvh, SahCosts
from renderer.pack.depth_first import depth_first, places
from renderer.pack.nodes import pack_nodes
from renderer.pack.schema import NODE_LAYOUTS

SEED = 17
SKIP, COUNT, FIRST = 2, 2, 8
LAYOUTS = ("skip", "skip-octants", "skip-wide")

Flags = npt.NDArray[np.bool_]


def tree(count: int) -> Bvh:
    corners = np.random.default_rng(SEED).random((count, 3, 3)).astype(np.float32)
    return build_bvh(np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1), SahCosts(1.0, 1.0))


def walked(name: str, count: int = 200) -> tuple[Bvh, Flags, int]:
    """The tree that a layout holds, which of its nodes are there, and in how many orders."""
    pruning = NODE_LAYOUTS[name]["f32"].pruning
    assert pruning is not None
    made, tested = pruned(tree(count), **vars(pruning))
    assert tested.sum() < len(tested) or count < 200
    return made, tested, 1 if name == "skip" else 8


def recursion(made: Bvh, tested: Flags, octant: int, node: int = 0) -> list[int]:
    """The tested nodes of a subtree in the order in which rays of an octant come to them."""
    own = [node] if tested[node] else []
    if made.count[node]:
        return own
    children = [int(made.child[node]), int(made.child[node]) + 1]
    if octant >> made.axis[node] & 1:
        children.reverse()
    return own + [below for child in children for below in recursion(made, tested, octant, child)]


@pytest.mark.parametrize("name", LAYOUTS[1:])
@pytest.mark.parametrize("octant", range(8))
@pytest.mark.parametrize("count", [1, 2, 3, 200])
def test_places_follow_the_recursion(count: int, octant: int, name: str) -> None:
    made, tested, _ = walked(name, count)
    place, size = places(depth_first(made, tested), octant), depth_first(made, tested).sizes
    order = recursion(made, tested, octant)
    assert sorted(order) == list(np.flatnonzero(tested))
    np.testing.assert_array_equal(place[order], np.arange(len(order)))
    for node in order:
        assert size[node] == len(recursion(made, tested, octant, node))


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_walk_that_enters_every_box_reads_every_leaf(name: str) -> None:
    made, tested, copies = walked(name)
    words = pack_nodes(tree(200), name).words[:-8].reshape(copies, -1, 8)
    assert words.shape[1] == tested.sum() + 1
    for octant in range(copies):
        leaves = [int(made.child[node]) for node in recursion(made, tested, octant) if made.count[node]]
        found, at = [], octant * words.shape[1]
        while (link := int(words.reshape(-1, 8)[at, 3])) != 0:
            at += 1
            if link & 3 == 0:
                found.append(link >> FIRST)
        assert found == leaves
        assert at == (octant + 1) * words.shape[1] - 1


@pytest.mark.parametrize("node_format", ["f32", "grid16", "half"])
@pytest.mark.parametrize("name", LAYOUTS)
def test_every_node_has_a_next_one(name: str, node_format: str) -> None:
    """A walk reads the node behind the one that ends it."""
    _, tested, copies = walked(name)
    words = 8 if node_format == "f32" else 4
    nodes = pack_nodes(tree(200), name, node_format).words.reshape(-1, words)
    assert len(nodes) == copies * (tested.sum() + 1) + 1
    assert not nodes[-2:].any()


@pytest.mark.parametrize("name", LAYOUTS[1:])
def test_a_walk_that_misses_skips_the_subtree(name: str) -> None:
    made, tested, _ = walked(name)
    words = pack_nodes(tree(200), name).words.reshape(-1, 8)
    stride = tested.sum() + 1
    nodes, inner = depth_first(made, tested), tested & (made.count == 0)
    for octant in range(8):
        place = places(nodes, octant)[inner]
        links = words[octant * stride + place, 3]
        np.testing.assert_array_equal(links >> SKIP, place + nodes.sizes[inner] + octant * stride)
        assert (links & 3 > 0).all()


def test_packing_loads_no_compiler(tmp_path: Path) -> None:
    """To load it takes half a second of a variant's first job."""
    made = tree(50)
    with (tmp_path / "tree").open("wb") as file:
        pickle.dump(made, file)
    code = (
        "import pickle, sys\nfrom renderer.pack.nodes import pack_nodes\n"
        f"tree = pickle.load(open(sys.argv[1], 'rb'))\nfor name in {LAYOUTS}: pack_nodes(tree, name)\n"
        "print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "tree"], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("node_format", ["f32", "grid16", "half"])
def test_near_faces_stand_first(node_format: str) -> None:
    """What an octant's copy says of a box is what one order says of it, faces exchanged where rays run backward."""
    made, tested, _ = walked("skip")
    words = 8 if node_format == "f32" else 4
    one = pack_nodes(tree(200), "skip", node_format).words.reshape(-1, words)
    all_ = pack_nodes(tree(200), "skip-octants", node_format).words[:-words].reshape(8, -1, words)
    nodes = depth_first(made, tested)
    plain = one[places(nodes, 0)[tested]]
    for octant in range(8):
        seen = all_[octant, places(nodes, octant)[tested]]
        for axis in range(3):
            backward = octant >> axis & 1
            if node_format == "f32":
                given = plain[:, [axis, axis + 4]]
                np.testing.assert_array_equal(seen[:, [axis, axis + 4]], given[:, ::-1] if backward else given)
            else:
                given = plain[:, axis]
                turned = given << np.uint32(16) | given >> np.uint32(16)
                np.testing.assert_array_equal(seen[:, axis], turned if backward else given)
