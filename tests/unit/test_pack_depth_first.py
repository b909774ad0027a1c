"""Depth-first nodes: a walk by links alone visits what a recursion visits, in each octant near children first."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.build.bvh import build_bvh
from renderer.build.tree import Bvh, SahCosts
from renderer.pack.depth_first import depth_first
from renderer.pack.nodes import pack_nodes

SEED = 17
SKIP, COUNT, FIRST = 2, 2, 8


def tree(count: int) -> Bvh:
    corners = np.random.default_rng(SEED).random((count, 3, 3)).astype(np.float32)
    return build_bvh(np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1), SahCosts(1.0, 1.0))


def recursion(made: Bvh, octant: int, node: int = 0) -> list[int]:
    if made.count[node]:
        return [node]
    children = [int(made.child[node]), int(made.child[node]) + 1]
    if octant >> made.axis[node] & 1:
        children.reverse()
    return [node, *recursion(made, octant, children[0]), *recursion(made, octant, children[1])]


@pytest.mark.parametrize("octant", range(8))
@pytest.mark.parametrize("count", [1, 2, 3, 200])
def test_places_follow_the_recursion(count: int, octant: int) -> None:
    made = tree(count)
    place, after = depth_first(made, octant)
    np.testing.assert_array_equal(np.argsort(place), recursion(made, octant))
    for node in range(len(made.count)):
        within = recursion(made, octant, node)
        assert after[node] - place[node] == len(within)


@pytest.mark.parametrize("name", ["skip", "skip-octants"])
def test_a_walk_that_enters_every_box_reads_every_leaf(name: str) -> None:
    made = tree(200)
    copies = 8 if name == "skip-octants" else 1
    words = pack_nodes(made, name).words[:-8].reshape(copies, -1, 8)
    assert words.shape[1] == len(made.count) + 1
    for octant in range(copies):
        leaves = [int(made.child[node]) for node in recursion(made, octant) if made.count[node]]
        found, at = [], octant * words.shape[1]
        while (link := int(words.reshape(-1, 8)[at, 3])) != 0:
            at += 1
            if link & 3 == 0:
                found.append(link >> FIRST)
        assert found == leaves
        assert at == (octant + 1) * words.shape[1] - 1


@pytest.mark.parametrize("node_format", ["f32", "grid16", "half"])
@pytest.mark.parametrize("name", ["skip", "skip-octants"])
def test_every_node_has_a_next_one(name: str, node_format: str) -> None:
    """A walk reads the node behind the one that ends it."""
    made = tree(200)
    words = 8 if node_format == "f32" else 4
    copies = 8 if name == "skip-octants" else 1
    nodes = pack_nodes(made, name, node_format).words.reshape(-1, words)
    assert len(nodes) == copies * (len(made.count) + 1) + 1
    assert not nodes[-2:].any()


def test_a_walk_that_misses_skips_the_subtree() -> None:
    made = tree(200)
    words = pack_nodes(made, "skip-octants").words.reshape(-1, 8)
    stride = len(made.count) + 1
    for octant in range(8):
        place, after = depth_first(made, octant)
        inner = made.count == 0
        links = words[octant * stride + place[inner], 3]
        np.testing.assert_array_equal(links >> SKIP, after[inner] + octant * stride)
        assert (links & 3 > 0).all()


@pytest.mark.parametrize("node_format", ["f32", "grid16", "half"])
def test_near_faces_stand_first(node_format: str) -> None:
    """What an octant's copy says of a box is what one order says of it, faces exchanged where rays run backward."""
    made = tree(50)
    words = 8 if node_format == "f32" else 4
    one = pack_nodes(made, "skip", node_format).words.reshape(-1, words)
    all_ = pack_nodes(made, "skip-octants", node_format).words[:-words].reshape(8, -1, words)
    for octant in range(8):
        seen, plain = all_[octant, depth_first(made, octant)[0]], one[depth_first(made, 0)[0]]
        for axis in range(3):
            backward = octant >> axis & 1
            if node_format == "f32":
                given = plain[:, [axis, axis + 4]]
                np.testing.assert_array_equal(seen[:, [axis, axis + 4]], given[:, ::-1] if backward else given)
            else:
                given = plain[:, axis]
                turned = given << np.uint32(16) | given >> np.uint32(16)
                np.testing.assert_array_equal(seen[:, axis], turned if backward else given)
