"""What a finished tree's links imply: node boxes, depth and SAH cost."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import Floats, Ints
from renderer.jit import jit

Flags = npt.NDArray[np.bool_]


def fit_boxes(boxes: Floats, child: Ints, count: Ints, order: Ints) -> tuple[Floats, Floats]:
    """The exact union of each node's triangle boxes, (n, 3) lower and upper; children come after parents."""
    lower, upper = np.empty((len(child), 3), np.float32), np.empty((len(child), 3), np.float32)
    _fit(boxes, child, count, order, lower, upper)
    return lower, upper


@jit
def _fit(boxes: Floats, child: Ints, count: Ints, order: Ints, lower: Floats, upper: Floats) -> None:
    for node in range(len(child) - 1, -1, -1):
        if count[node] == 0:
            left = child[node]
            for axis in range(3):
                lower[node, axis] = min(lower[left, axis], lower[left + 1, axis])
                upper[node, axis] = max(upper[left, axis], upper[left + 1, axis])
            continue
        x0, y0, z0 = np.float32(np.inf), np.float32(np.inf), np.float32(np.inf)
        x1, y1, z1 = np.float32(-np.inf), np.float32(-np.inf), np.float32(-np.inf)
        for slot in range(child[node], child[node] + count[node]):
            box = boxes[order[slot]]
            x0, y0, z0 = min(x0, box[0, 0]), min(y0, box[0, 1]), min(z0, box[0, 2])
            x1, y1, z1 = max(x1, box[1, 0]), max(y1, box[1, 1]), max(z1, box[1, 2])
        lower[node, 0], lower[node, 1], lower[node, 2] = x0, y0, z0
        upper[node, 0], upper[node, 1], upper[node, 2] = x1, y1, z1


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
