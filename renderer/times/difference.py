"""Whether one set of frame times is slower than another: the ratio with its 95 % interval, and a verdict.

Frames of one slice share a process, a clock and a moment and are correlated, so a round counts once, by one figure:
the top level of repetition alone tells how well a result repeats (Kalibera and Jones, Rigorous Benchmarking in
Reasonable Time, 2013). The interval is the exact one of the rank-sum test (Hodges and Lehmann, Estimates of Location
Based on Rank Tests, 1963): it holds for any distribution, from 4 rounds a side on, and rounds that a neighbour slowed
to twice their time hardly widen it. A bootstrap over so few rounds covers too little; Student's t holds too, but on
such rounds needs several times as many to see as much.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Literal

from renderer.times.interval import CONFIDENCE, median

Verdict = Literal["faster", "slower", "no difference found", "undecided"]
Figure = Literal["median", "fastest"]

NEGLIGIBLE = 0.05
"""An interval within 5 % of 1 on both sides is called no difference."""
POWER = 0.9
"""How often the smallest visible difference is found."""
MOST_ROUNDS = 100
"""So many rounds a side are looked at, evenly spread where there are more."""

_Z = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
_REACH = 1 + NormalDist().inv_cdf(POWER) / _Z


class DifferenceError(ValueError):
    """Frames that cannot be compared; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Difference:
    """How the second set's frame time stands to the first's; 1.1 is 10 % slower.

    `low` and `high` bound `ratio` with 95 % confidence; `visible` is the smallest slowdown, 0.1 for 10 %, that as many
    rounds with as much noise find in about 9 of 10 tries (the interval's half width with that power's share of the
    normal distribution on top). None where the rounds are too few for an interval.
    """

    ratio: float
    low: float | None
    high: float | None
    visible: float | None
    rounds: tuple[int, int]

    @property
    def verdict(self) -> Verdict:
        """Faster or slower where the interval leaves out 1, none found where it is within NEGLIGIBLE, or undecided."""
        if self.low is None or self.high is None:
            return "undecided"
        if self.low > 1 or self.high < 1:
            return "slower" if self.low > 1 else "faster"
        near = self.low >= 1 / (1 + NEGLIGIBLE) and self.high <= 1 + NEGLIGIBLE
        return "no difference found" if near else "undecided"

    def is_slower_by(self, margin: float) -> bool:
        """Whether even the lower bound of the slowdown passes `margin`, a fraction."""
        return self.low is not None and self.low > 1 + margin


def difference(
    baseline: Sequence[Sequence[float]], against: Sequence[Sequence[float]], figure: Figure = "median"
) -> Difference:
    """Compare frame times, one sequence a round, in one unit; raise DifferenceError without positive times.

    A round's figure is its median, or its `fastest` of as many frames as every round has: the better one where
    disturbance only ever adds time. The ratio is the median over all pairs of a round of each side.
    """
    if not (_are_times(baseline) and _are_times(against)):
        raise DifferenceError("Frame times are missing or not positive: give at least one round of timed frames.")
    shortest = min(len(frames) for frames in (*baseline, *against))
    first, second = (_logarithms(side, figure, shortest) for side in (baseline, against))
    shifts = sorted(theirs - ours for ours in first for theirs in second)
    ratio, rounds = math.exp(median(shifts)), (len(first), len(second))
    cut = _cut(*rounds)
    if cut == 0:
        return Difference(ratio, None, None, None, rounds)
    low, high = shifts[cut - 1], shifts[-cut]
    return Difference(ratio, math.exp(low), math.exp(high), math.expm1((high - low) / 2 * _REACH), rounds)


def by_round(frames: Sequence[float], counts: Sequence[int] | None) -> list[list[float]]:
    """Frames, given one after another, as rounds of `counts` frames; without counts that fit they are one round."""
    if not counts or sum(counts) != len(frames):
        return [list(frames)]
    ends = [sum(counts[: i + 1]) for i in range(len(counts))]
    return [list(frames[end - count : end]) for count, end in zip(counts, ends, strict=True) if count]


def share_interval(found: int, tries: int) -> tuple[float, float]:
    """The 95 % interval of a share of tries (Wilson, Probable Inference, 1927)."""
    share, spread = found / tries, _Z * _Z / tries
    middle = (share + spread / 2) / (1 + spread)
    reach = _Z * math.sqrt(share * (1 - share) / tries + spread / tries / 4) / (1 + spread)
    return max(0.0, middle - reach), min(1.0, middle + reach)


def _are_times(rounds: Sequence[Sequence[float]]) -> bool:
    return bool(rounds) and all(frames and all(0 < time < math.inf for time in frames) for frames in rounds)


def _logarithms(rounds: Sequence[Sequence[float]], figure: Figure, shortest: int) -> list[float]:
    step = max(1.0, len(rounds) / MOST_ROUNDS)
    chosen = [rounds[int(i * step)] for i in range(min(len(rounds), MOST_ROUNDS))]
    return [math.log(median(frames) if figure == "median" else min(frames[:shortest])) for frames in chosen]


@lru_cache(maxsize=256)
def _cut(first: int, second: int) -> int:
    """How many of the sorted shifts lie outside the 95 % interval at each end, plus 1; 0 where they are too few.

    The largest k with 2 P(U < k) <= 5 %, U the rank sum's statistic: its counts are the coefficients of the Gaussian
    binomial, the product over i = 1..first of (1 - q^(second + i)) / (1 - q^i).
    """
    counts = [1] + [0] * (first * second // 2)
    for i in range(1, first + 1):
        for power in range(len(counts) - 1, second + i - 1, -1):
            counts[power] -= counts[power - second - i]
        for power in range(i, len(counts)):
            counts[power] += counts[power - i]
    total, tail, allowed = math.comb(first + second, first), 0, 0
    for k, count in enumerate(counts):
        tail += count
        if 2 * tail > (1 - CONFIDENCE) * total:
            break
        allowed = k + 1
    return allowed
