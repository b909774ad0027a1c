"""Trees into node buffers, by the layouts of `schema`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from renderer.build.parallel import blocks, each
from renderer.build.pruned import pruned
from renderer.build.tree import KD_LEAF, Bvh, Kd, Tree, WideBvh
from renderer.pack.depth_first import OCTANTS, depth_first, lay_out
from renderer.pack.grid import Grid, grid_over
from renderer.pack.primitives import unsigned_zeros
from renderer.pack.quads import child_values, framed_values
from renderer.pack.schema import LEAF, NODE_LAYOUTS, TAIL, Field, NodeLayout

Words = npt.NDArray[np.uint32]
Flags = npt.NDArray[np.bool_]
Face = npt.NDArray[np.float32]
Values = dict[str, npt.NDArray[np.generic]]


_LINK = 3  # the word of a BVH node that says what is below it


class PackError(ValueError):
    """A tree that does not fit a node layout's bits."""


@dataclass(frozen=True, eq=False)
class PackedNodes:
    """A node buffer: `words` uint32; `tail_at`, the chunk at which what follows the nodes begins, None where nothing
    does; `grid`, on which its boxes lie, None where they are floats."""

    words: Words
    tail_at: int | None = None
    grid: Grid | None = None


def pack_nodes(tree: Tree | WideBvh, layout_name: str, node_format: str = "f32") -> PackedNodes:
    """Lay a tree's nodes out in the layout's order; with siblings beside each other node 1 is unused.

    A wide BVH is for layouts in the order `quads`. Raise PackError when a value needs more than its field has.
    """
    layout = NODE_LAYOUTS[layout_name][node_format]
    if isinstance(tree, WideBvh):
        return _pack_quads(tree, layout)
    if layout.order != "siblings":
        assert isinstance(tree, Bvh)
        return _pack_depth_first(tree, layout)
    values = _values(tree)
    leaf = values["axis"] == LEAF
    grid = _box_words(values, layout, tree.lower[0], tree.upper[0])
    words = np.zeros((len(leaf) + 1, layout.words), np.uint32)
    tail = np.zeros(len(leaf) + 1, np.uint32)
    slots = np.where(np.arange(len(leaf)) == 0, 0, np.arange(len(leaf)) + 1)
    _store_all(words, tail, slots, layout, values, leaf)
    match layout.tail:
        case "none":
            return PackedNodes(words.ravel(), None, grid)
        case "triangles":
            assert isinstance(tree, Kd)
            tail = tree.refs.astype(np.uint32)
        case "paths":
            from renderer.pack.paths import path_table

            assert isinstance(tree, Bvh)
            tail = path_table(tree.child, tree.count, words[slots, _LINK])
    return PackedNodes(_append(words, tail, layout), words.size // layout.vector, grid)


def _pack_quads(tree: WideBvh, layout: NodeLayout) -> PackedNodes:
    framed = layout.field("origin") is not None
    grid: Grid | None = None
    if framed:
        values, frames = framed_values(tree)
        _require_float32(frames)
    else:
        values = child_values(tree)
        grid = _box_words(values, layout, tree.lower[0].min(axis=0), tree.upper[0].max(axis=0))
    rows = len(values["origin" if framed else "axis"])
    words = np.zeros((rows, layout.words), np.uint32)
    leaf = np.full(rows, False) if framed else values["axis"] == LEAF
    _store_all(words, words[:, 0], np.arange(rows), layout, values, leaf)
    return PackedNodes(words.ravel(), None, grid)


def _box_words(values: Values, layout: NodeLayout, lower: Face, upper: Face) -> Grid | None:
    """Put the words of packed boxes beside the values, where the layout has them; the grid over the root's, if any."""
    box = layout.field("box")
    if box is None:
        return None
    if box.kind == "half":
        values["box"] = _halves(values["lower"], values["upper"])
        return None
    grid = grid_over(lower, upper)
    _require_float32(grid)
    values["box"] = words = np.empty(values["lower"].shape, np.uint32)

    def put(block: slice) -> None:
        faces = values["lower"][block], values["upper"][block]
        low, high = grid.outward(np.clip(faces[0], lower, upper), np.clip(faces[1], lower, upper))
        words[block] = low | high << np.uint32(16)

    each([partial(put, block) for block in blocks(len(words))])
    return grid


def _pack_depth_first(tree: Bvh, layout: NodeLayout) -> PackedNodes:
    """The nodes in one order, or in an order for each octant, as NodeLayout says."""
    assert layout.pruning is not None
    tree, tested = pruned(tree, **vars(layout.pruning))
    values = _values(tree, tested)
    leaf = values["axis"] == LEAF
    nodes = len(leaf)
    grid = _box_words(values, layout, tree.lower[0], tree.upper[0])
    rows = np.zeros((nodes, layout.words), np.uint32)
    unlinked = replace(layout, fields=tuple(field for field in layout.fields if field.name != "skip"))
    _store_all(rows, rows[:, 0], np.arange(nodes), unlinked, values, leaf)
    copies = OCTANTS if layout.order == "octants" else 1
    words = np.zeros((copies * (nodes + 1) + 1, layout.words), np.uint32)
    faces, skip = _face_words(layout), layout.named("skip")
    _require_room(skip, 0, len(words) - 2)
    found = depth_first(tree, tested)
    each(
        [
            partial(lay_out, found, rows, octant, faces, (skip.word, skip.shift), octant * (nodes + 1), copy)
            for octant, copy in enumerate(words[:-1].reshape(copies, nodes + 1, layout.words))
        ]
    )
    return PackedNodes(words.ravel(), None, grid)


def _face_words(layout: NodeLayout) -> tuple[int, int]:
    """The words where a box's lower and upper faces begin: one and the same where a word has both."""
    box = layout.field("box")
    return (box.word, box.word) if box else (layout.named("lower").word, layout.named("upper").word)


def _store_all(
    words: Words, tail: Words, slots: npt.NDArray[np.generic], layout: NodeLayout, values: Values, leaf: Flags
) -> None:
    owners: dict[str, slice | Flags] = {"all": slice(None), "inner": ~leaf, "leaf": leaf}
    for field in layout.fields:
        rows = owners[field.owner]
        stored = tail[:, None] if field.word == TAIL else words[:, field.word :]
        _store(stored, slots[rows], field, values[field.name][rows])


def _require_float32(grid: Grid) -> None:
    if (np.abs(grid.origin) > np.finfo(np.float32).max).any():
        raise PackError("The scene is too large for a grid in float32: take the node format f32.")


@np.errstate(over="ignore")
def _halves(*faces: npt.NDArray[np.generic]) -> Words:
    """Boxes rounded to the nearest half-precision floats: a face may move inward, and beyond 65,504 it is infinite."""
    lower, upper = (np.ascontiguousarray(side.astype(np.float16) + np.float16(0)) for side in faces)
    words: Words = lower.view(np.uint16) | upper.view(np.uint16).astype(np.uint32) << np.uint32(16)
    return words


def _values(tree: Tree, of: slice | Flags = slice(None)) -> Values:
    """Every field of every node, or of those chosen by `of`; children and parents counted with the unused node 1."""
    leaf = tree.count > 0 if isinstance(tree, Bvh) else tree.axis == KD_LEAF
    axis = np.where(leaf, LEAF, tree.axis + 1).astype(np.int64)
    child, above = tree.child[of].astype(np.int64), tree.parent[of]
    parent = np.maximum(above, 0).astype(np.int64)
    values: Values = {
        "lower": tree.lower[of],
        "upper": tree.upper[of],
        "axis": axis[of],
        "child": child + 1,
        "first": child,
        "count": tree.count[of].astype(np.int64),
        "parent": parent + (parent > 0),
        "parent_axis": np.where(above >= 0, axis[parent], 0),
    }
    if isinstance(tree, Kd):
        values["split"] = tree.split[of]
    return values


def _store(words: Words, slots: npt.NDArray[np.generic], field: Field, values: npt.NDArray[np.generic]) -> None:
    """Put a field's values into `words` from its first word on."""
    if field.kind == "vec3":
        words[slots, :3] = unsigned_zeros(values)
    elif field.kind == "float":
        words[slots, 0] = unsigned_zeros(values)
    elif field.kind in ("grid16", "half"):
        words[slots, :3] = values
    else:
        if len(values):
            _require_room(field, values.min(), values.max())
        words[slots, 0] |= values.astype(np.uint32) << np.uint32(field.shift)


def _require_room(field: Field, least: int, most: int) -> None:
    if least < 0 or most >= 1 << field.bits:
        raise PackError(f"Node field {field.name} needs {most}, more than its {field.bits} bits hold.")


def _append(words: Words, behind: Words, layout: NodeLayout) -> Words:
    return np.concatenate([words.ravel(), behind, np.zeros(-len(behind) % layout.vector, np.uint32)])
