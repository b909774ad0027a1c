"""The median of frame times and its confidence interval, from the raw frames."""

from __future__ import annotations

import math
from collections.abc import Sequence

CONFIDENCE = 0.95


def median(values: Sequence[float]) -> float:
    """The median of at least one value."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """The 95 % interval of the median from order statistics, free of any assumption on the distribution.

    The interval between the k-th smallest and the k-th largest value covers the median with probability
    1 - 2 P(Binomial(n, 1/2) < k); the largest k that keeps 95 % is taken. Fewer than 6 values cannot give one: None.
    """
    ordered = sorted(values)
    n = len(ordered)
    tail, k = 0.0, 0
    while k < n:
        tail += math.comb(n, k) / 2**n
        if 2 * tail > 1 - CONFIDENCE:
            break
        k += 1
    return None if k == 0 else (ordered[k - 1], ordered[n - k])
