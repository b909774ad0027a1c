from __future__ import annotations

import numpy as np
import pytest

from renderer.build.radix import sort_keys, stable_order


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("number", [0, 1, 2, 1000, 70000])
def test_the_order_is_that_of_a_stable_sort(number: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = np.ldexp(rng.choice([-1.0, -0.0, 0.0, 1.0, 1.5], number), rng.integers(-149, 127, number))
    values = values.astype(np.float32)
    np.testing.assert_array_equal(stable_order(sort_keys(values)), np.argsort(values, kind="stable"))


def test_infinities_come_first_and_last() -> None:
    values = np.array([np.inf, 3.4e38, -np.inf, 0.0, -3.4e38], np.float32)
    assert list(stable_order(sort_keys(values))) == [2, 4, 3, 1, 0]
