"""Many differences at once: false alarms stay rare whatever else is true, and planted differences are found."""

from __future__ import annotations

import numpy as np
import pytest

from server.paper.multiple import LEVEL, larger

TRIES = 600


def alarms(seed: int, rounds: int, shifts: np.ndarray, *, shared: bool) -> float:
    """The share of tries in which a pair without a larger first side is called larger."""
    chance = np.random.default_rng(seed)
    found = 0
    for _ in range(TRIES):
        second = chance.normal(size=(1 if shared else len(shifts), rounds))
        first = chance.normal(size=(len(shifts), rounds)) + shifts[:, None]
        pairs = [(first[k], second[0 if shared else k]) for k in range(len(shifts))]
        values = larger(pairs)
        found += any(p <= LEVEL for p, shift in zip(values, shifts, strict=True) if shift <= 0)
    return found / TRIES


@pytest.mark.parametrize("shared", [False, True], ids=["own-rivals", "one-rival"])
@pytest.mark.parametrize("rounds", [4, 6])
@pytest.mark.parametrize(
    "shifts", [np.zeros(1), np.zeros(12), np.array([0.0] * 6 + [-5.0] * 6), np.array([0.0] * 6 + [3.0] * 6)],
    ids=["one", "twelve", "half-smaller", "half-larger"],
)  # fmt: skip
def test_false_alarms_stay_below_the_level(rounds: int, shifts: np.ndarray, shared: bool) -> None:
    share = alarms(seed=11, rounds=rounds, shifts=shifts, shared=shared)
    # Three standard deviations of a share of so many tries above the level itself.
    assert share <= LEVEL + 3 * (LEVEL * (1 - LEVEL) / TRIES) ** 0.5


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("others", [0.0, -0.3])
def test_one_larger_pair_of_many_is_found_in_four_rounds(others: float, seed: int) -> None:
    chance = np.random.default_rng(seed)
    found = 0
    for _ in range(200):
        shifts = np.array([0.1] + [others] * 23)
        first = chance.normal(scale=0.005, size=(24, 4)) + shifts[:, None]
        values = larger(list(zip(first, chance.normal(scale=0.005, size=(24, 4)), strict=True)))
        found += values[0] <= LEVEL
    assert found >= 190


def test_too_few_rounds_find_nothing() -> None:
    [value] = larger([(np.array([9.0, 9.1, 9.2]), np.array([0.0, 0.1, 0.2]))])
    assert value > LEVEL


def test_many_rounds_are_dealt_at_random_and_the_same_each_time() -> None:
    chance = np.random.default_rng(5)
    pairs = [(chance.normal(size=20) + shift, chance.normal(size=20)) for shift in (0.0, 3.0)]
    first = larger(pairs)
    assert first == larger(pairs)
    assert first[0] > LEVEL >= first[1]
