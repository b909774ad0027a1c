"""The median and its 95 % interval against the binomial table and against drawn samples."""

from __future__ import annotations

import random
from fractions import Fraction
from math import comb

import numpy as np
import pytest

from renderer.times.interval import median, median_interval

# n: the rank k of the lower end, counted from 1, as tables of the sign test give it at 5 % two-sided.
TABLE = {6: 1, 8: 1, 9: 2, 10: 2, 11: 2, 12: 3, 15: 4, 20: 6, 25: 8, 30: 10, 50: 18, 100: 40}


def below(k: int, n: int) -> Fraction:
    """P(Binomial(n, 1/2) < k), exactly."""
    return Fraction(sum(comb(n, i) for i in range(k)), 2**n)


@pytest.mark.parametrize("n", range(1, 6))
def test_too_few_values_give_no_interval(n: int) -> None:
    assert median_interval(range(n)) is None


@pytest.mark.parametrize(("n", "k"), TABLE.items())
def test_ranks_are_the_table_s(n: int, k: int) -> None:
    assert median_interval(range(1, n + 1)) == (k, n + 1 - k)


@pytest.mark.parametrize("n", range(6, 200))
def test_the_interval_is_the_narrowest_that_covers(n: int) -> None:
    interval = median_interval(range(1, n + 1))
    assert interval is not None
    k = int(interval[0])
    assert 2 * below(k, n) <= Fraction(5, 100) < 2 * below(k + 1, n)


def test_drawn_intervals_cover_the_median() -> None:
    rng = np.random.default_rng(51)
    draws = rng.exponential(1.0, (4000, 15))
    intervals = [median_interval(list(row)) for row in draws]
    covered = sum(low <= np.log(2) <= high for low, high in (i for i in intervals if i is not None))
    # 96.5 % is exact for 15 values; four standard errors of 4000 draws are 1.2 %.
    assert abs(covered / 4000 - 0.965) < 0.012


@pytest.mark.parametrize("n", [1, 2, 7, 10])
def test_the_median_is_numpy_s(n: int) -> None:
    values = [random.Random(52 + n).random() for _ in range(n)]
    assert median(values) == pytest.approx(float(np.median(values)), rel=1e-15)
    assert median(values[::-1]) == median(values)
