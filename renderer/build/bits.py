"""Sets of up to 64 as the bits of one word."""

from __future__ import annotations

import numpy as np

from renderer.jit import jit

ONE = np.uint64(1)
NONE = np.uint64(0)


@jit
def ones(word: np.uint64) -> int:
    """How many bits are set; compilers know this way of adding them up as one instruction."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int(np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56)))


@jit
def lowest(word: np.uint64) -> int:
    """The place of the lowest bit that is set."""
    return ones((word & (~word + ONE)) - ONE)


@jit
def below(place: int) -> np.uint64:
    """All bits below a place of 0 to 64."""
    return ~NONE if place == 64 else (ONE << np.uint64(place)) - ONE
