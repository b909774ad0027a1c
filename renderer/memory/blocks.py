"""Blocks of 8x8 pixels: a stratified sample of those that an image has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

SIDE = 8
"""Pixels a side of a block; `shaders/common_reads.glsl` has it too."""

LANES = SIDE * SIDE
_SEED = 4

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Blocks:
    """n blocks: `index` (n,), row by row from the bottom left; `weight` (n,), how many blocks each one stands for."""

    index: Ints
    weight: Ints

    def __len__(self) -> int:
        """The number of blocks."""
        return len(self.index)


def grid_of(size: tuple[int, int]) -> tuple[int, int]:
    """How many blocks cover an image of `size` pixels: columns and rows."""
    width, height = size
    return -(-width // SIDE), -(-height // SIDE)


def choose_blocks(size: tuple[int, int], most: int) -> Blocks:
    """At most `most` blocks of an image, one at random out of each of as many patches; the same ones every time.

    A patch is a run of blocks in Morton order; patches differ by at most one block, which the weights make good.
    """
    columns, rows = grid_of(size)
    index = np.arange(columns * rows)
    order = index[np.argsort(_morton(index % columns, index // columns))]
    count = min(most, len(order))
    edges = np.arange(count + 1) * len(order) // count
    weight = np.diff(edges)
    return Blocks(order[edges[:-1] + np.random.default_rng(_SEED).integers(0, weight)], weight)


def _morton(x: Ints, y: Ints) -> Ints:
    code = np.zeros_like(x)
    for bit in range(16):
        code |= (x >> bit & 1) << 2 * bit | (y >> bit & 1) << 2 * bit + 1
    return code
