"""Few variants in which every two values of different axes meet: what a test of all combinations would mostly find."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from renderer.variant import Variant

Pair = tuple[str, str, str, str]


def meeting(candidates: Sequence[Variant], axes: Sequence[str], held: Iterable[Variant] = ()) -> list[Variant]:
    """Some candidates in which every two values of `axes` meet that meet in any, but for those that meet in `held`.

    Greedy: each is the first of those that bring most pairs.
    """
    left = _all_pairs(candidates, axes) - _all_pairs(held, axes)
    pairs = [_pairs(variant, axes) for variant in candidates]
    chosen: list[Variant] = []
    while left:
        best = max(range(len(candidates)), key=lambda i: len(pairs[i] & left))
        chosen.append(candidates[best])
        left -= pairs[best]
    return chosen


def _all_pairs(variants: Iterable[Variant], axes: Sequence[str]) -> set[Pair]:
    return set().union(*(_pairs(variant, axes) for variant in variants))


def _pairs(variant: Variant, axes: Sequence[str]) -> set[Pair]:
    return {(a, getattr(variant, a), b, getattr(variant, b)) for a, b in combinations(axes, 2)}
