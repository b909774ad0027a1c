"""Subtrees over few triangles are those that the sweep over events makes, cell by cell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from build_soups import Floats, soup

from renderer.build.kd_events import root_lists
from renderer.build.kd_nodes import Nodes, room_for_nodes
from renderer.build.kd_plane import best_plane
from renderer.build.kd_small import FEW, finish, room_for_cells, take
from renderer.build.pad import around
from renderer.build.tree import KD_LEAF, Ints

DEEPEST = 12


def on_a_grid(boxes: Floats) -> Floats:
    """Faces that many share, and flat boxes among them."""
    return (np.round(boxes * 4) / 4).astype(np.float32)


def finished(boxes: Floats, traversal: float) -> Any:
    """The tree as nested (axis, plane, left, right), a leaf as its triangles."""
    lists, spans = root_lists(boxes, 2)
    cells, rank = room_for_cells(), np.empty(len(boxes), np.uint32)
    take(cells, lists, spans[0], np.arange(len(boxes), dtype=np.int32), np.stack(around(boxes)), rank)
    nodes, refs = room_for_nodes(1), np.empty(1, np.int32)
    nodes, _, refs, _ = finish(cells, 0, 0, nodes, 1, refs, 0, DEEPEST, traversal, 1.0)
    return _nested(nodes, refs, 0)


def _nested(nodes: Nodes, refs: Ints, node: int) -> Any:
    child = int(nodes.child[node])
    if nodes.axis[node] == KD_LEAF:
        return refs[child : child + nodes.size[node]].tolist()
    below = (_nested(nodes, refs, child), _nested(nodes, refs, child + 1))
    return (int(nodes.axis[node]), float(nodes.split[node]), *below)


def swept(boxes: Floats, ids: Ints, cell: Floats, depth: int, traversal: float) -> Any:
    """The same, each cell's events made anew from what its triangles' boxes have in it."""
    axis, plane, flat_left = KD_LEAF, np.float32(0), True
    if len(ids) and depth < DEEPEST:
        lists, spans = root_lists(boxes, 2)
        axis, plane, flat_left = best_plane(lists.pos, lists.code, spans[0], len(ids), cell[0], cell[1], traversal, 1.0)
    if axis == KD_LEAF:
        return ids.tolist()
    low, high = boxes[:, 0, axis], boxes[:, 1, axis]
    flat = (low == plane) & (high == plane)
    below = []
    for side, there in ((1, (low < plane) | (flat & flat_left)), (0, (high > plane) | (flat & (not flat_left)))):
        part, parts = cell.copy(), boxes[there].copy()
        part[side, axis] = plane
        cut = np.minimum if side else np.maximum
        parts[:, side, axis] = cut(parts[:, side, axis], plane)
        below.append(swept(parts, ids[there], part, depth + 1, traversal))
    return (int(axis), float(plane), *below)


@pytest.mark.parametrize("seed", range(200))
def test_the_same_tree_is_made(seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = int(rng.integers(1, FEW + 1))
    boxes = soup(number, seed, size=float(rng.choice([0.05, 0.3, 1.0])))
    if seed % 2:
        boxes = on_a_grid(boxes)
    traversal = float(rng.choice([0.1, 1.0, 4.0]))
    ids = np.arange(number, dtype=np.int32)
    assert finished(boxes, traversal) == swept(boxes, ids, np.stack(around(boxes)), 0, traversal)
