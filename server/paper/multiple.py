"""Many differences tested at once, so that one found by chance does not refute a claim about all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import numpy.typing as npt

from server.paper.series import Series

LEVEL = 0.025
"""One-sided, as each end of a 95 % interval."""
MOST = 5000
"""So many ways to deal the rounds to the sides are looked at; all of them where there are no more."""
SEED = 20190001
MIN_TOTAL = 3
"""A variance needs so many rounds."""


def larger(pairs: Sequence[tuple[Series, Series]]) -> list[float]:
    """For each pair the p value of its first side not being larger, adjusted for all pairs together.

    Rounds are dealt anew to the two sides, in all pairs alike; a pair's p is the share of deals in which the largest
    of all pairs' t statistics reaches its own (Westfall and Young, Resampling-Based Multiple Testing, 1993, the
    single-step max-T). A pair whose first side is clearly smaller, at LEVEL by itself, cannot alarm and does not count
    to the largest (after Hansen, A Test for Superior Predictive Ability, 2005). All first sides have as many rounds,
    and all second sides too.
    """
    ours = len(pairs[0][0])
    if ours + len(pairs[0][1]) < MIN_TOTAL:
        return [1.0] * len(pairs)
    rounds = np.stack([np.concatenate(pair) for pair in pairs])
    rounds = rounds - rounds.mean(axis=1, keepdims=True)
    statistics = _statistics(rounds, _deals(ours, rounds.shape[1]))
    smaller = (statistics <= statistics[:, :1] + 1e-9).mean(axis=1) <= LEVEL
    most = statistics[~smaller].max(axis=0, initial=-math.inf)
    found = [np.maximum(most, own) >= own[0] - 1e-9 for own in statistics]
    return [float(np.mean(reached)) for reached in found]


def _deals(ours: int, total: int) -> npt.NDArray[np.float64]:
    """Ways to deal rounds, (ways, total) of 1 for the first side; the real one comes first."""
    if math.comb(total, ours) <= MOST:
        chosen = np.array(list(combinations(range(total), ours)))
    else:
        chance = np.random.default_rng(SEED)
        drawn = chance.permuted(np.tile(np.arange(total), (MOST, 1)), axis=1)[:, :ours]
        chosen = np.concatenate([np.arange(ours)[None], drawn])
    deals = np.zeros((len(chosen), total))
    np.put_along_axis(deals, chosen, 1.0, axis=1)
    return deals


def _statistics(rounds: npt.NDArray[np.float64], deals: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Student's t of every pair (rows) under every deal (columns)."""
    n, m = deals[0].sum(), (1 - deals[0]).sum()
    first, second = rounds @ deals.T / n, rounds @ (1 - deals).T / m
    within = (rounds**2).sum(axis=1, keepdims=True) - n * first**2 - m * second**2
    deviation = np.sqrt(np.maximum(within, 0) / (n + m - 2) * (1 / n + 1 / m))
    found: npt.NDArray[np.float64] = (first - second) / (deviation + 1e-9)
    return found
