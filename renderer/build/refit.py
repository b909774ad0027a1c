"""What a finished tree's links imply: node boxes, depth and SAH cost."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Floats, Ints
from renderer.jit import jit

Flags = npt.NDArray[np.bool_]


@jit
def fit_boxes(boxes: Floats, child: Ints, count: Ints, order: Ints) -> tuple[Floats, Floats]:
    """The exact union of each node's triangle boxes, (n, 3) lower and upper; children come after parents."""
    lower = np.full((len(child), 3), np.float32(np.inf), np.float32)
    upper = np.full((len(child), 3), np.float32(-np.inf), np.float32)
    for node in range(len(child) - 1, -1, -1):
        for axis in range(3):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            if count[node] == 0:
                low = min(lower[child[node], axis], lower[child[node] + 1, axis])
                high = max(upper[child[node], axis], upper[child[node] + 1, axis])
            for slot in range(child[node], child[node] + count[node]):
                low = min(low, boxes[order[slot], 0, axis])
                high = max(high, boxes[order[slot], 1, axis])
            lower[node, axis], upper[node, axis] = low, high
    return lower, upper


@jit
def depth_of(parent: Ints) -> int:
    """Edges on the longest path from the root; parents come before children."""
    depth = np.zeros(len(parent), np.int32)
    deepest = 0
    for node in range(1, len(parent)):
        depth[node] = depth[parent[node]] + 1
        deepest = max(deepest, depth[node])
    return deepest


@jit
def sah_cost(lower: Floats, upper: Floats, is_leaf: Flags, count: Ints, traversal: float, intersection: float) -> float:
    """Sum over nodes of area / root area times the node's cost; where the root has no area every ratio is 1."""
    total, root = 0.0, half_area(lower, upper, 0)
    for node in range(len(count)):
        ratio = half_area(lower, upper, node) / root if root > 0.0 else 1.0
        total += ratio * (intersection * count[node] if is_leaf[node] else traversal)
    return total


@jit
def half_area(lower: Floats, upper: Floats, node: int) -> float:
    """Half the surface of a node's box, in float64."""
    x = np.float64(upper[node, 0]) - np.float64(lower[node, 0])
    y = np.float64(upper[node, 1]) - np.float64(lower[node, 1])
    z = np.float64(upper[node, 2]) - np.float64(lower[node, 2])
    return x * y + z * (x + y)
