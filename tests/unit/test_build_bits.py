"""Sets of up to 64 as the bits of one word."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.build.bits import below, lowest, ones


@pytest.mark.parametrize(
    "word", [1, 1 << 63, (1 << 64) - 1, *np.random.default_rng(1).integers(1, 1 << 62, 20).tolist()]
)
def test_bits_are_counted_and_the_lowest_found(word: int) -> None:
    assert ones(np.uint64(word)) == word.bit_count()
    assert 1 << lowest(np.uint64(word)) == word & -word


@pytest.mark.parametrize("place", [0, 1, 31, 63, 64])
def test_all_bits_below_a_place(place: int) -> None:
    assert int(below(place)) == (1 << place) - 1
