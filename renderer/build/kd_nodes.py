"""A KD-tree's node arrays while they grow, and the joining of subtrees that were built apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.build.grow import resized, resized_rows
from renderer.build.kd_events import Lists, Spans
from renderer.build.tree import KD_LEAF, Bytes, Floats, Ints
from renderer.jit import jit


class Nodes(NamedTuple):
    """A `Kd`'s node arrays; `size` is its `count`. One that waits for a task is a leaf of size -1."""

    lower: Floats
    upper: Floats
    split: Floats
    axis: Bytes
    child: Ints
    size: Ints
    parent: Ints


class Waiting(NamedTuple):
    """Cells cut off for tasks of their own: node and depth (w, 2), their lists, and the spans in these (w, 4, 2).

    A cell's lists name its triangles by their rank in its own list; `ids` are what `Lists.triangle` would name.
    """

    cells: npt.NDArray[np.int64]
    spans: Spans
    lists: Lists


class Part(NamedTuple):
    """A subtree, its root first, with its leaves' triangles."""

    nodes: Nodes
    refs: Ints
    waiting: Waiting


def one_node(lower: Floats, upper: Floats, room: int) -> Nodes:
    """Room for as many nodes, with the root's cell."""
    nodes = Nodes(
        lower=np.empty((room, 3), np.float32),
        upper=np.empty((room, 3), np.float32),
        split=np.empty(room, np.float32),
        axis=np.empty(room, np.uint8),
        child=np.empty(room, np.int32),
        size=np.empty(room, np.int32),
        parent=np.empty(room, np.int32),
    )
    nodes.lower[0], nodes.upper[0], nodes.parent[0] = lower, upper, -1
    return nodes


@jit
def with_children(nodes: Nodes, node: int, made: int, axis: int, plane: np.float32) -> Nodes:
    """Two children from slot `made` on, with the cells that the plane leaves them."""
    if made + 2 > len(nodes.axis):
        nodes = nodes_resized(nodes, 2 * (made + 2))
    nodes.child[node], nodes.size[node] = made, 0
    for child in range(made, made + 2):
        for side in range(3):
            nodes.lower[child, side], nodes.upper[child, side] = nodes.lower[node, side], nodes.upper[node, side]
        nodes.parent[child] = node
    nodes.upper[made, axis], nodes.lower[made + 1, axis] = plane, plane
    return nodes


@jit
def nodes_resized(nodes: Nodes, room: int) -> Nodes:
    """As `resized`, all arrays."""
    return Nodes(
        resized_rows(nodes.lower, room),
        resized_rows(nodes.upper, room),
        resized(nodes.split, room),
        resized(nodes.axis, room),
        resized(nodes.child, room),
        resized(nodes.size, room),
        resized(nodes.parent, room),
    )


def joined(first: Part, parts: list[Part]) -> tuple[Nodes, Ints]:
    """One tree: the roots of `parts` lie where they are waited for, their other nodes and leaves after `first`'s."""
    nodes, refs = [first.nodes], [first.refs]
    made, filled = len(first.nodes.axis), len(first.refs)
    for (place, _), part in zip(first.waiting.cells.tolist(), parts, strict=True):
        own = part.nodes
        child = own.child + np.where(own.axis == KD_LEAF, np.int32(filled), np.int32(made - 1))
        parent = np.where(own.parent == 0, place, own.parent + np.int32(made - 1)).astype(np.int32)
        for target, source in (
            (first.nodes.split, own.split),
            (first.nodes.axis, own.axis),
            (first.nodes.child, child),
            (first.nodes.size, own.size),
        ):
            target[place] = source[0]
        nodes.append(
            Nodes(own.lower[1:], own.upper[1:], own.split[1:], own.axis[1:], child[1:], own.size[1:], parent[1:])
        )
        refs.append(part.refs)
        made, filled = made + len(own.axis) - 1, filled + len(part.refs)
    whole = Nodes(
        np.concatenate([part.lower for part in nodes]),
        np.concatenate([part.upper for part in nodes]),
        np.concatenate([part.split for part in nodes]),
        np.concatenate([part.axis for part in nodes]),
        np.concatenate([part.child for part in nodes]),
        np.concatenate([part.size for part in nodes]),
        np.concatenate([part.parent for part in nodes]),
    )
    return whole, np.concatenate(refs)
