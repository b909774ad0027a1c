"""Every inner node's children are found by the path that leads to it, in trees of any shape."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.build.tree import MAX_DEPTH
from renderer.pack.paths import Ints, bucket_count, entry_count, path_table

LOW = (1 << 32) - 1


def grown(seed: int, inner: int, *, deep: bool) -> tuple[Ints, Ints]:
    """`child` and `count` of a tree that splits a leaf drawn at random, or the one made last, till MAX_DEPTH."""
    rng = np.random.default_rng(seed)
    child, count, depth = [0], [1], [0]
    for _ in range(inner):
        leaves = [node for node in range(len(child)) if count[node] and depth[node] < MAX_DEPTH]
        node = leaves[-1] if deep else int(rng.choice(leaves))
        child[node], count[node] = len(child), 0
        child += [0, 0]
        count += [1, 1]
        depth += [depth[node] + 1] * 2
    return np.array(child, np.int32), np.array(count, np.int32)


def mixed(x: int) -> int:
    """As `path_mixed` of `shaders/common_path.glsl`."""
    x = (x ^ x >> 16) * 0x7FEB352D & LOW
    x = (x ^ x >> 15) * 0x846CA68B & LOW
    return x ^ x >> 16


@pytest.mark.parametrize(("inner", "deep"), [(0, False), (1, False), (5, False), (64, True), (400, False), (300, True)])
@pytest.mark.parametrize("seed", [3, 4])
def test_children_are_found_by_path(seed: int, inner: int, *, deep: bool) -> None:
    child, count = grown(seed, inner, deep=deep)
    links = np.random.default_rng(seed).integers(0, 1 << 32, len(child), np.uint32)
    table = path_table(child, count, links)
    buckets, entries = bucket_count(inner), entry_count(inner)
    assert len(table) == buckets + 2 * entries
    path = {0: 1}
    for node in range(len(child)):
        if count[node]:
            continue
        path |= {int(child[node]) + side: path[node] << 1 | side for side in (0, 1)}
        low, high = path[node] & LOW, path[node] >> 32
        assert high <= LOW, "a path needs more than 64 bits"
        displacement = int(table[mixed(low ^ mixed(high)) * buckets >> 32])
        at = mixed(low + mixed(high + displacement + 1 & LOW) & LOW) * entries >> 32
        found = table[buckets + 2 * at : buckets + 2 * at + 2]
        assert found.tolist() == links[child[node] : child[node] + 2].tolist()
