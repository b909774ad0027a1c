"""The ratio of two times measured side by side, round by round, with its exact interval.

What a round does to the machine it does to both, so the ratio within a round is steadier than either time. The interval
is that of the signed-rank test over the rounds' log ratios (Hodges and Lehmann, Estimates of Location Based on Rank
Tests, 1963): it assumes symmetry about the true ratio and no more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from renderer.times.interval import CONFIDENCE, median


@dataclass(frozen=True)
class Ratio:
    """How the second's time stands to the first's; 1.1 is 10 % slower. No interval where the rounds are too few."""

    ratio: float
    low: float | None
    high: float | None

    @property
    def told_apart(self) -> bool:
        """Whether the interval leaves out 1."""
        return self.low is not None and self.high is not None and (self.low > 1 or self.high < 1)


def paired_ratio(first: Sequence[float], second: Sequence[float], confidence: float = CONFIDENCE) -> Ratio:
    """The ratio of `second` to `first`, positive times of the same rounds in the same order, at least one.

    The estimate is the median of the Walsh averages, the means of all pairs of rounds, a round with itself included.
    """
    shifts = [math.log(theirs / ours) for ours, theirs in zip(first, second, strict=True)]
    averages = sorted((a + b) / 2 for i, a in enumerate(shifts) for b in shifts[i:])
    ratio, cut = math.exp(median(averages)), signed_rank_cut(len(shifts), confidence)
    if cut == 0:
        return Ratio(ratio, None, None)
    return Ratio(ratio, math.exp(averages[cut - 1]), math.exp(averages[-cut]))


@lru_cache(maxsize=256)
def signed_rank_cut(rounds: int, confidence: float) -> int:
    """How many of the sorted Walsh averages lie outside the interval at each end, plus 1; 0 where they are too few.

    The largest k with 2 P(T < k) <= 1 - confidence; of the 2^n ways to sign the ranks 1..n, those with a positive sum
    of t are the coefficient of q^t in the product of 1 + q^i.
    """
    counts = [1] + [0] * (rounds * (rounds + 1) // 2)
    for rank in range(1, rounds + 1):
        for total in range(len(counts) - 1, rank - 1, -1):
            counts[total] += counts[total - rank]
    tail, cut = 0, 0
    for k, count in enumerate(counts):
        tail += count
        if 2 * tail > (1 - confidence) * 2**rounds:
            break
        cut = k + 1
    return cut
