"""A KD-tree's node arrays while they grow, and the joining of subtrees that were built apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized
from renderer.build.kd_events import Lists, Spans
from renderer.build.tree import KD_LEAF, Bytes, Floats, Ints
from renderer.jit import jit


class Nodes(NamedTuple):
    """Of a `Kd`'s node arrays those that a build finds out; `size` is its `count`. One that waits is an empty leaf."""

    split: Floats
    axis: Bytes
    child: Ints
    size: Ints


class Waiting(NamedTuple):
    """Cells cut off for tasks of their own: node and depth (w, 2), where they lie (w, 2, 3), their lists, and the spans
    in these (w, 4, 2).

    A cell's lists name its triangles by their rank in its own list; `ids` are what `Lists.triangle` would name.
    """

    cells: npt.NDArray[np.int64]
    boxes: Floats
    spans: Spans
    lists: Lists


class Part(NamedTuple):
    """A subtree, its root first, with its leaves' triangles."""

    nodes: Nodes
    refs: Ints
    waiting: Waiting


@jit
def room_for_nodes(room: int) -> Nodes:
    """As many, undefined; what is never written takes no memory."""
    return Nodes(
        np.empty(room, np.float32),
        np.empty(room, np.uint8),
        np.empty(room, np.int32),
        np.empty(room, np.int32),
    )


@jit
def nodes_resized(nodes: Nodes, room: int) -> Nodes:
    """As `resized`, all arrays."""
    return Nodes(
        resized(nodes.split, room),
        resized(nodes.axis, room),
        resized(nodes.child, room),
        resized(nodes.size, room),
    )


@jit
def halve(box: Floats, right: Floats, left: Floats, axis: int, plane: np.float32) -> None:
    """The cells, (2, 3) each, that a plane makes of `box`, which may be one of them."""
    for k in range(3):
        low, high = box[0, k], box[1, k]
        right[0, k], right[1, k], left[0, k], left[1, k] = low, high, low, high
    right[0, axis], left[1, axis] = plane, plane


def joined(first: Part, parts: list[Part]) -> tuple[Nodes, Ints]:
    """One tree: the roots of `parts` lie where they are waited for, their other nodes and leaves after `first`'s."""
    nodes, refs = [first.nodes], [first.refs]
    made, filled = len(first.nodes.axis), len(first.refs)
    for (place, _), part in zip(first.waiting.cells.tolist(), parts, strict=True):
        own = part.nodes
        # In place: nobody else reads a part.
        own.child[:] += np.where(own.axis == KD_LEAF, np.int32(filled), np.int32(made - 1))
        _put_root(own, first.nodes, place)
        nodes.append(Nodes(own.split[1:], own.axis[1:], own.child[1:], own.size[1:]))
        refs.append(part.refs)
        made, filled = made + len(own.axis) - 1, filled + len(part.refs)
    whole = Nodes(
        np.concatenate([part.split for part in nodes]),
        np.concatenate([part.axis for part in nodes]),
        np.concatenate([part.child for part in nodes]),
        np.concatenate([part.size for part in nodes]),
    )
    return whole, np.concatenate(refs)


def _put_root(own: Nodes, nodes: Nodes, place: int) -> None:
    nodes.split[place], nodes.axis[place] = own.split[0], own.axis[0]
    nodes.child[place], nodes.size[place] = own.child[0], own.size[0]


def cells_of(nodes: Nodes, root: Floats) -> tuple[Floats, Floats, Ints]:
    """Every node's cell, (n, 3) float32 twice, and its parent, given the `root`'s cell (2, 3)."""
    count = len(nodes.axis)
    lower, upper, parent = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty(count, np.int32)
    lower[0], upper[0], parent[0] = root[0], root[1], -1
    _hand_down(nodes.split, nodes.axis, nodes.child, lower, upper, parent)
    return lower, upper, parent


@jit
def _hand_down(split: Floats, axis: Bytes, child: Ints, lower: Floats, upper: Floats, parent: Ints) -> None:
    """Parents come before their children."""
    for node in range(len(axis)):
        if axis[node] == KD_LEAF:
            continue
        left = child[node]
        for k in range(3):
            lower[left, k], lower[left + 1, k] = lower[node, k], lower[node, k]
            upper[left, k], upper[left + 1, k] = upper[node, k], upper[node, k]
        upper[left, axis[node]], lower[left + 1, axis[node]] = split[node], split[node]
        parent[left], parent[left + 1] = node, node
