"""The table by which a walk goes back to any node in constant time (Binder and Keller 2016): from paths to children.

An inner node's path is a 1, then a bit for each edge from the root: 1 for a right child. Its entry holds its children's
link words. The hash is perfect: a first hash of the path finds a bucket, which tells the displacement with which a
second one finds the entry (Belazzougui, Botelho and Dietzfelbinger 2009). So two reads find it, and walks ask only for
paths that are there. `shaders/traversal_bvh_backtrack.glsl` computes the same.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Words = npt.NDArray[np.uint32]
Ints = npt.NDArray[np.int32]
Paths = npt.NDArray[np.uint64]

MOST_TRIES = 1 << 24


def bucket_count(inner: int) -> int:
    """The buckets for a tree of that many inner nodes: about four paths in each, and an even number."""
    return (inner >> 3) * 2 + 2


def entry_count(inner: int) -> int:
    """The entries for as many: of five, four are used."""
    return inner + (inner >> 2) + 1


def path_table(child: Ints, count: Ints, links: Words) -> Words:
    """The displacements of the buckets, then the entries, two words each; `links` (n,) are the nodes' link words.

    Of depths over 63 edges a path would not fit; builders stop at 64, and a deepest level has no inner nodes.
    """
    inner = np.flatnonzero(count == 0).astype(np.int32)
    displacement, entry = _hashed(_paths(child, count)[inner], bucket_count(len(inner)), entry_count(len(inner)))
    table = np.zeros((entry_count(len(inner)), 2), np.uint32)
    table[entry, 0], table[entry, 1] = links[child[inner]], links[child[inner] + 1]
    return np.concatenate([displacement, table.ravel()])


@jit
def _paths(child: Ints, count: Ints) -> Paths:
    paths = np.ones(len(child), np.uint64)
    for node in range(len(child)):
        if count[node] == 0:
            paths[child[node]] = paths[node] << np.uint64(1)
            paths[child[node] + 1] = paths[node] << np.uint64(1) | np.uint64(1)
    return paths


@jit
def _hashed(paths: Paths, buckets: int, entries: int) -> tuple[Words, Ints]:
    """A displacement for each bucket, and each path's entry; the fullest buckets choose first."""
    bucket = np.empty(len(paths), np.int32)
    size = np.zeros(buckets, np.int32)
    for i in range(len(paths)):
        bucket[i] = _bucket(paths[i], buckets)
        size[bucket[i]] += 1
    start = np.zeros(buckets + 1, np.int32)
    for i in range(buckets):
        start[i + 1] = start[i] + size[i]
    member, filled = np.empty(len(paths), np.int32), start[:-1].copy()
    for i in range(len(paths)):
        member[filled[bucket[i]]] = i
        filled[bucket[i]] += 1
    displacement, entry = np.zeros(buckets, np.uint32), np.empty(len(paths), np.int32)
    taken = np.zeros(entries, np.bool_)
    for which in np.argsort(-size, kind="mergesort"):
        members = member[start[which] : start[which + 1]]
        displacement[which] = _place(paths, members, entry, taken)
        for i in members:
            taken[entry[i]] = True
    return displacement, entry


@jit
def _place(paths: Paths, members: Ints, entry: Ints, taken: npt.NDArray[np.bool_]) -> int:
    """The first displacement that gives a bucket's paths entries of their own that are free."""
    for tried in range(MOST_TRIES):
        free = True
        for k in range(len(members)):
            at = _entry(paths[members[k]], np.uint32(tried), len(taken))
            entry[members[k]] = at
            for other in range(k):
                free = free and entry[members[other]] != at
            if not free or taken[at]:
                free = False
                break
        if free:
            return tried
    raise ValueError("No displacement keeps the paths of a bucket apart.")


@jit
def _bucket(path: np.uint64, buckets: int) -> np.int32:
    low, high = np.uint32(path & np.uint64(0xFFFFFFFF)), np.uint32(path >> np.uint64(32))
    return _share(_mixed(np.uint32(low ^ _mixed(high))), buckets)


@jit
def _entry(path: np.uint64, displacement: np.uint32, entries: int) -> np.int32:
    low, high = np.uint32(path & np.uint64(0xFFFFFFFF)), np.uint32(path >> np.uint64(32))
    return _share(_mixed(np.uint32(low + _mixed(np.uint32(high + displacement + np.uint32(1))))), entries)


@jit
def _share(hashed: np.uint32, parts: int) -> np.int32:
    """A hash into one of so many equal parts: the high word of their product."""
    return np.int32((np.uint64(hashed) * np.uint64(parts)) >> np.uint64(32))


@jit
def _mixed(word: np.uint32) -> np.uint32:
    """A bijection of 32-bit words in which every bit counts for every other (Wellons' lowbias32)."""
    x = np.uint32(np.uint32(word ^ (word >> np.uint32(16))) * np.uint32(0x7FEB352D))
    x = np.uint32(np.uint32(x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))
