"""Differences: the interval is exact, a round counts once, and real noise neither alarms nor hides a slowdown."""

from __future__ import annotations

import json
import math
import random
from itertools import combinations
from pathlib import Path

import pytest

from renderer.times.difference import MOST_ROUNDS, DifferenceError, Figure, by_round, difference, share_interval

NOISE = json.loads((Path(__file__).parents[1] / "fixtures" / "rounds_busy.json").read_text())
TRIES = 200

Rounds = list[list[float]]


def draw(seed: int, clock: str, rounds: int) -> tuple[Rounds, Rounds]:
    """Two sides of real rounds of one request, interleaved in the order in which they were measured."""
    chance = random.Random(seed)
    slices: Rounds = NOISE[clock]
    chosen = sorted(chance.sample(range(len(slices)), 2 * rounds))
    sides: tuple[Rounds, Rounds] = ([], [])
    for i in range(0, 2 * rounds, 2):
        first = chance.randrange(2)
        sides[first].append(slices[chosen[i]])
        sides[1 - first].append(slices[chosen[i + 1]])
    return sides


def slowed(rounds: Rounds, factor: float) -> Rounds:
    return [[time * factor for time in frames] for frames in rounds]


@pytest.mark.parametrize("rounds", [4, 5])
def test_the_interval_is_exact_over_every_way_to_deal_the_rounds(rounds: int) -> None:
    """Of all ways to deal 2n rounds of one thing to two sides, at most 5 % are called different, and not none."""
    times = [[1.0 + i * i / 7] for i in range(2 * rounds)]
    dealt = [set(chosen) for chosen in combinations(range(2 * rounds), rounds)]
    called = [
        difference([times[i] for i in chosen], [times[i] for i in range(2 * rounds) if i not in chosen]).verdict
        for chosen in dealt
    ]
    alarms = sum(verdict in ("faster", "slower") for verdict in called)
    expected = {4: 2, 5: 8}  # U = 0 of 70; U <= 2 of 252, which 1 + 1 + 2 ways a side give.
    assert alarms == expected[rounds]
    assert alarms / len(dealt) <= 0.05


@pytest.mark.parametrize(("rounds", "critical"), [(5, 2), (8, 13), (10, 23), (20, 127)])
def test_the_cut_is_that_of_the_published_table(rounds: int, critical: int) -> None:
    """Critical values of U for 5 %, two-sided (Mann and Whitney's test): one more shift is cut off at each end."""
    first = [[math.exp(i / 7)] for i in range(rounds)]
    second = [[math.exp(math.sqrt(2) * i)] for i in range(rounds)]
    shifts = sorted(math.sqrt(2) * j - i / 7 for i in range(rounds) for j in range(rounds))
    found = difference(first, second)
    assert found.low == pytest.approx(math.exp(shifts[critical]))
    assert found.high == pytest.approx(math.exp(shifts[-1 - critical]))


@pytest.mark.parametrize("clock", ["cpu_ms", "wall_ms"])
@pytest.mark.parametrize("rounds", [6, 10, 20])
def test_real_noise_alarms_at_most_in_5_of_100(clock: str, rounds: int) -> None:
    """Seeds 0 to 199; 16 of 200 is what a rate of 5 % stays within in 97 of 100 such tests."""
    figure: Figure = "fastest" if clock == "cpu_ms" else "median"
    found = [difference(*draw(seed, clock, rounds), figure) for seed in range(TRIES)]
    assert sum(item.verdict in ("faster", "slower") for item in found) <= 16
    assert sum(item.is_slower_by(0.01) for item in found) <= 10


def test_a_planted_slowdown_is_found_in_real_noise() -> None:
    """10 % on the processor time of a machine that is kept busy: 9 of 10 with 20 rounds. Seeds 0 to 199."""
    found = 0
    for seed in range(TRIES):
        ours, theirs = draw(seed, "cpu_ms", 20)
        found += difference(ours, slowed(theirs, 1.1), "fastest").verdict == "slower"
    assert found / TRIES >= 0.9


def test_what_is_called_visible_is_found_in_about_9_of_10() -> None:
    """Seeds 0 to 199: each pair's noise, slowed by the median of what the pairs call visible."""
    drawn = [draw(seed, "cpu_ms", 20) for seed in range(TRIES)]
    visible = sorted(difference(*sides, "fastest").visible or math.inf for sides in drawn)[TRIES // 2]
    found = [difference(ours, slowed(theirs, 1 + visible), "fastest").verdict == "slower" for ours, theirs in drawn]
    assert 0.8 <= sum(found) / TRIES <= 1


def test_many_frames_of_few_rounds_are_no_certainty() -> None:
    found = difference([[1.0] * 1000] * 3, [[2.0] * 1000] * 3)
    assert found.ratio == pytest.approx(2.0)
    assert (found.low, found.high, found.visible) == (None, None, None)
    assert found.verdict == "undecided"
    assert not found.is_slower_by(0.0)


def test_repeating_the_frames_of_a_round_changes_nothing() -> None:
    ours, theirs = draw(7, "wall_ms", 8)
    assert difference([frames * 50 for frames in ours], [frames * 50 for frames in theirs]) == difference(ours, theirs)


def test_more_frames_a_round_are_no_advantage_to_the_fastest() -> None:
    chance = random.Random(11)
    few = [[1 + chance.expovariate(2) for _ in range(3)] for _ in range(40)]
    many = [[1 + chance.expovariate(2) for _ in range(60)] for _ in range(40)]
    assert difference(few, many, "fastest").verdict != "faster"


def test_swapping_the_sides_turns_the_ratio_round() -> None:
    ours, theirs = draw(3, "cpu_ms", 9)
    there, back = difference(ours, theirs), difference(theirs, ours)
    assert there.low is not None
    assert back.high is not None
    assert there.ratio * back.ratio == pytest.approx(1)
    assert there.low * back.high == pytest.approx(1)


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.5, "slower"), (0.5, "faster"), (1.0, "no difference found"), (1.02, "slower")]
)
def test_verdicts(factor: float, verdict: str) -> None:
    steady = [[1 + i * 1e-4] for i in range(10)]
    assert difference(steady, slowed(steady, factor)).verdict == verdict


def test_an_interval_over_more_than_5_percent_is_undecided() -> None:
    wide = [[1 + i * 0.05] for i in range(10)]
    assert difference(wide, wide).verdict == "undecided"


def test_a_gate_looks_at_the_lower_bound() -> None:
    steady = [[1 + i * 1e-3] for i in range(10)]
    found = difference(steady, slowed(steady, 1.1))
    assert found.low is not None
    assert found.is_slower_by(found.low - 1.001)
    assert not found.is_slower_by(found.low - 0.999)


def test_thousands_of_rounds_are_thinned() -> None:
    found = difference([[1.0, 1.1]] * 5000, [[1.2]] * 150)
    assert found.rounds == (MOST_ROUNDS, MOST_ROUNDS)
    assert found.verdict == "slower"


@pytest.mark.parametrize("times", [[], [[]], [[1.0], []], [[0.0]], [[-1.0]], [[math.nan]], [[math.inf]]])
def test_what_is_no_time_is_refused(times: Rounds) -> None:
    for sides in (([[1.0]], times), (times, [[1.0]])):
        with pytest.raises(DifferenceError, match="at least one round of timed frames"):
            difference(*sides)


@pytest.mark.parametrize("counts", [None, [], [2, 2], [9]])
def test_frames_without_fitting_counts_are_one_round(counts: list[int] | None) -> None:
    assert by_round([1.0, 2.0, 3.0], counts) == [[1.0, 2.0, 3.0]]


def test_frames_are_split_by_their_counts() -> None:
    assert by_round([1.0, 2.0, 3.0], [1, 0, 2]) == [[1.0], [2.0, 3.0]]


@pytest.mark.parametrize(
    ("found", "tries", "low", "high"), [(0, 40, 0, 0.0876), (2, 40, 0.0138, 0.165), (1, 1, 0.207, 1)]
)
def test_shares_have_wilsons_interval(found: int, tries: int, low: float, high: float) -> None:
    assert share_interval(found, tries) == pytest.approx((low, high), abs=1e-3)
