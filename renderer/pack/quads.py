"""Wide BVHs of four children a node into node buffers: a box and a link word a child, or 8-bit faces in a frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.build.tree import EMPTY, WideBvh
from renderer.pack.grid import Grid, grid_over
from renderer.pack.schema import LEAF

Words = npt.NDArray[np.uint32]
Values = dict[str, npt.NDArray[np.generic]]

FRAME_CELLS = 255
"""The most cells along an axis that 8 bits count."""

_EXPONENT_BIAS = 127


def child_values(tree: WideBvh) -> Values:
    """Every field of every child, (4 n) rows; an empty place is a leaf without triangles, in a box of zeros."""
    count = tree.count.ravel()
    empty, inner = count == EMPTY, count == 0
    child = tree.child.ravel().astype(np.int64)
    return {
        "lower": _faces(tree.lower, empty),
        "upper": _faces(tree.upper, empty),
        "axis": np.where(inner, 1, LEAF),
        "child": child * tree.width,
        "first": np.where(empty, 0, child),
        "count": np.maximum(count, 0).astype(np.int64),
    }


def _faces(faces: npt.NDArray[np.float32], empty: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
    return np.where(empty[:, None], np.float32(0), faces.reshape(-1, 3))


def framed_values(tree: WideBvh) -> tuple[Values, Grid]:
    """Every field of nodes whose children's faces are counted from a frame of their own, and the frames' grids.

    A child's box is at least one cell wide along x, by which it is told from an empty place, all zeros.
    """
    there = tree.count != EMPTY
    frame = grid_over(tree.lower.min(axis=1), tree.upper.max(axis=1), FRAME_CELLS)
    spread = Grid(frame.origin[:, None], frame.cell[:, None])
    low, high = (np.where(there[:, :, None], faces, 0) for faces in spread.outward(*_within(tree, there)))
    high[:, :, 0] = np.where(there, np.maximum(high[:, :, 0], low[:, :, 0] + 1), 0)
    exponents = np.frexp(frame.cell)[1] - 1 + _EXPONENT_BIAS
    inner, leaf = tree.count == 0, tree.count > 0
    values: Values = {
        "origin": frame.origin.astype(np.float32),
        "base": _first(tree.child, inner),
        "slots": _first(tree.child, leaf),
        "counts": _side_by_side(np.maximum(tree.count, 0), 6),
    }
    for axis, name in enumerate("xyz"):
        values[f"exponent_{name}"] = exponents[:, axis]
        values[f"lower_{name}"] = _side_by_side(low[:, :, axis], 8)
        values[f"upper_{name}"] = _side_by_side(high[:, :, axis], 8)
    return values, frame


def _first(child: npt.NDArray[np.int32], which: npt.NDArray[np.bool_]) -> npt.NDArray[np.int32]:
    """Of each node's children of a kind the least number, 0 where there are none: the others' follow."""
    least: npt.NDArray[np.int32] = np.where(which, child, np.iinfo(np.int32).max).min(axis=1) * which.any(axis=1)
    return least


def _within(tree: WideBvh, there: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """The children's boxes, those of empty places any that lies in the frame."""
    lower = np.where(there[:, :, None], tree.lower, tree.lower.min(axis=1, keepdims=True))
    return lower, np.where(there[:, :, None], tree.upper, lower)


def _side_by_side(values: npt.NDArray[np.generic], bits: int) -> npt.NDArray[np.int64]:
    """Four values a node (n, 4) in one word."""
    shifted = values.astype(np.int64) << (bits * np.arange(4))
    word: npt.NDArray[np.int64] = shifted.sum(axis=1)
    return word
