"""Spearman's rank correlation, and its interval by resampling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

DRAWS = 2000
SEED = 20190002
ENDS = (2.5, 97.5)


@dataclass(frozen=True, eq=False)
class Group:
    """What is ranked together: predictors, each (variants,), and logarithms of frame times, (variants, rounds)."""

    name: str
    predictors: tuple[Array, ...]
    times: Array


def spearman(first: Array, second: Array) -> Array:
    """Spearman's correlation along the last axis, ties at their mean rank; nan where one side is all alike."""
    ranks = [_ranks(each) for each in (first, second)]
    ours, theirs = (each - each.mean(axis=-1, keepdims=True) for each in ranks)
    scale = np.sqrt((ours**2).sum(-1) * (theirs**2).sum(-1))
    with np.errstate(invalid="ignore", divide="ignore"):
        found: Array = np.where(scale > 0, (ours * theirs).sum(-1) / scale, np.nan)
    return found


def correlations(group: Group) -> Array:
    """Each predictor's correlation with the median time over rounds, (predictors,)."""
    times = np.median(group.times, axis=1)
    return np.array([float(spearman(predictor, times)) for predictor in group.predictors])


def resampled(groups: Sequence[Group], *, whole: bool) -> Array:
    """The mean over groups of each predictor's correlation in DRAWS resamples, (predictors, draws).

    Rounds are drawn with replacement, and so are the variants within each group, or with `whole` the groups
    themselves, whose few variants stay as they are.
    """
    chance = np.random.default_rng(SEED)
    drawn = np.stack([_draw(group, chance, whole=whole) for group in groups])
    if whole:
        chosen = chance.integers(len(groups), size=(len(groups), 1, DRAWS))
        drawn = np.take_along_axis(drawn, np.broadcast_to(chosen, drawn.shape), axis=0)
    known = ~np.isnan(drawn)
    sums, counts = np.where(known, drawn, 0).sum(axis=0), known.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        means: Array = np.where(counts > 0, sums / counts, np.nan)
    return means


def ends(draws: Array) -> tuple[float, float] | None:
    """The 95 % percentile interval of what was drawn; None where too little could be computed."""
    known = draws[~np.isnan(draws)]
    if len(known) < DRAWS / 2:
        return None
    low, high = np.percentile(known, ENDS)
    return float(low), float(high)


def _draw(group: Group, chance: np.random.Generator, *, whole: bool) -> Array:
    variants, rounds = group.times.shape
    times = np.median(group.times[:, chance.integers(rounds, size=(DRAWS, rounds))], axis=2).T
    if whole:
        chosen = np.broadcast_to(np.arange(variants), (DRAWS, variants))
    else:
        chosen = chance.integers(variants, size=(DRAWS, variants))
    mine = np.take_along_axis(times, chosen, axis=1)
    return np.stack([spearman(predictor[chosen], mine) for predictor in group.predictors])


def _ranks(values: Array) -> Array:
    below = (values[..., None, :] < values[..., :, None]).sum(-1)
    alike = (values[..., None, :] == values[..., :, None]).sum(-1)
    ranks: Array = below + (alike + 1) / 2
    return ranks
