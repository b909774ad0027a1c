"""Trees into node buffers, by the layouts of `schema`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.build.tree import KD_LEAF, Bvh, Kd, Tree
from renderer.pack.primitives import unsigned_zeros
from renderer.pack.schema import LEAF, NODE_LAYOUTS, Field, NodeLayout

Words = npt.NDArray[np.uint32]


class PackError(ValueError):
    """A tree that does not fit a node layout's bits."""


@dataclass(frozen=True, eq=False)
class PackedNodes:
    """A node buffer: `words` uint32, and `refs_at`, the chunk at which a KD-tree's list of triangles begins."""

    words: Words
    refs_at: int


def pack_nodes(tree: Tree, layout_name: str) -> PackedNodes:
    """Lay a tree's nodes out. Node 0 is the root and 1 is unused, so that siblings are an even and an odd index.

    Raise PackError when a value needs more bits than its field has.
    """
    layout = NODE_LAYOUTS[layout_name]
    values = _values(tree)
    leaf = values["axis"] == LEAF
    words = np.zeros((len(leaf) + 1, layout.words), np.uint32)
    slots = np.where(np.arange(len(leaf)) == 0, 0, np.arange(len(leaf)) + 1)
    for field in layout.fields:
        rows = {"all": slice(None), "inner": ~leaf, "leaf": leaf}[field.owner]
        _store(words, slots[rows], field, values[field.name][rows])
    refs_at = words.size // layout.vector
    if not layout.refs:
        return PackedNodes(words.ravel(), refs_at)
    assert isinstance(tree, Kd)
    return PackedNodes(_append_refs(words, tree, layout), refs_at)


def _values(tree: Tree) -> dict[str, npt.NDArray[np.generic]]:
    """Every field of every node, children and parents counted with the unused node 1."""
    leaf = tree.count > 0 if isinstance(tree, Bvh) else tree.axis == KD_LEAF
    axis = np.where(leaf, LEAF, tree.axis + 1).astype(np.int64)
    parent = np.maximum(tree.parent, 0).astype(np.int64)
    values: dict[str, npt.NDArray[np.generic]] = {
        "lower": tree.lower,
        "upper": tree.upper,
        "axis": axis,
        "child": tree.child.astype(np.int64) + 1,
        "first": tree.child.astype(np.int64),
        "count": tree.count.astype(np.int64),
        "parent": parent + (parent > 0),
        "parent_axis": np.where(tree.parent >= 0, axis[parent], 0),
    }
    if isinstance(tree, Kd):
        values["split"] = tree.split
    return values


def _store(words: Words, slots: npt.NDArray[np.generic], field: Field, values: npt.NDArray[np.generic]) -> None:
    if field.kind == "vec3":
        words[slots, field.word : field.word + 3] = unsigned_zeros(values)
    elif field.kind == "float":
        words[slots, field.word] = unsigned_zeros(values)
    else:
        if len(values) and (values.min() < 0 or values.max() >= 1 << field.bits):
            raise PackError(f"Node field {field.name} needs {values.max()}, more than its {field.bits} bits hold.")
        words[slots, field.word] |= values.astype(np.uint32) << np.uint32(field.shift)


def _append_refs(words: Words, tree: Kd, layout: NodeLayout) -> Words:
    padding = -len(tree.refs) % layout.vector
    refs = np.concatenate([tree.refs.astype(np.uint32), np.zeros(padding, np.uint32)])
    return np.concatenate([words.ravel(), refs])
