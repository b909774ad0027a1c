"""The deepest BVH there is, which no builder makes: for stacks and trails at their limits."""

from __future__ import annotations

import numpy as np

from renderer.build.tree import Bvh, Floats


def chain_bvh(triangles: Floats, *, rightward: bool) -> Bvh:
    """A BVH of depth m - 1 over `triangles` (m, 3, 3): every inner node parts one off, in their order along x."""
    m = len(triangles)
    spans, child, count, parent, last = [(0, m)], [0], [0], [-1], 0
    while spans[last][1] - spans[last][0] > 1:
        low, high = spans[last]
        middle = low + 1 if rightward else high - 1
        child[last] = len(spans)
        spans += [(low, middle), (middle, high)]
        child, count, parent = [*child, 0, 0], [*count, 0, 0], [*parent, last, last]
        last = len(spans) - (1 if rightward else 2)
    for node, (low, high) in enumerate(spans):
        if high - low == 1:
            child[node], count[node] = low, 1
    return Bvh(
        lower=np.stack([triangles[low:high].min(axis=(0, 1)) for low, high in spans]),
        upper=np.stack([triangles[low:high].max(axis=(0, 1)) for low, high in spans]),
        child=np.array(child, np.int32),
        count=np.array(count, np.int32),
        axis=np.zeros(len(spans), np.uint8),
        parent=np.array(parent, np.int32),
        order=np.arange(m, dtype=np.int32),
        depth=m - 1,
        cost=0.0,
    )
