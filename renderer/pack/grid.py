"""The grids on which 16-bit and 8-bit node boxes lie: found so that what a shader makes of them is exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint32]

CELLS = 65_535
"""The most cells along an axis that 16 bits count."""

_DIGITS = 24
_LEAST = -126


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of a power of two along each axis, counted from `origin`, a multiple of them: (3,) float64 both, or (n, 3)
    for a grid a node.

    `origin + cells * cell` needs no more digits than float32 has, so a shader computes it without rounding, however its
    compiler arranges it. A face that is rounded outward to the grid thus stays outside, and a box only grows.
    """

    origin: Doubles
    cell: Doubles

    def outward(self, lower: npt.NDArray[np.float32], upper: npt.NDArray[np.float32]) -> tuple[Words, Words]:
        """The cells of the lower and of the upper faces of boxes (n, 3)."""
        # Divided before they are subtracted: that way neither rounds.
        first = self.origin / self.cell
        low = np.floor(lower.astype(np.float64) / self.cell) - first
        high = np.ceil(upper.astype(np.float64) / self.cell) - first
        return low.astype(np.uint32), high.astype(np.uint32)


def grid_over(lower: npt.NDArray[np.float32], upper: npt.NDArray[np.float32], cells: int = CELLS) -> Grid:
    """The finest grid of at most `cells` cells an axis over a finite box, (3,) each, or over each of (n, 3)."""
    low, high = lower.astype(np.float64), upper.astype(np.float64)
    exponent = np.maximum(_ceil_log2((high - low) / (cells - 1)), _ceil_log2(np.maximum(-low, high)) - _DIGITS)
    cell = np.ldexp(1.0, np.maximum(exponent, _LEAST))
    return Grid(np.floor(low / cell) * cell + 0.0, cell)


def _ceil_log2(values: Doubles) -> npt.NDArray[np.int64]:
    """The least whole exponents whose powers of two are not less than the values; that of 0 and less is the least."""
    fraction, exponent = np.frexp(np.maximum(values, np.ldexp(1.0, _LEAST)))
    least: npt.NDArray[np.int64] = exponent.astype(np.int64) - (fraction == 0.5)
    return least
