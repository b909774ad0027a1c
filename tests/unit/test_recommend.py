"""Recommendations on simulated devices: near the best, within budgets, in a fraction of the time, and honest."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from itertools import product

import pytest

from renderer.recommend.halving import (
    FAR,
    MARGIN,
    PILOT_ROUNDS,
    Candidate,
    Judged,
    Size,
    Standing,
    Terms,
    Verdict,
    pilot_sizes,
    recommend,
)
from renderer.times.interval import median
from renderer.times.paired import paired_ratio, signed_rank_cut

SIZE = (512, 512)
SEEDS = range(60)


class Device:
    """Variants with true times, on a machine that drifts, with noise and now and then a neighbour."""

    def __init__(self, seed: int, number: int, noise: float = 0.02) -> None:
        self.chance = random.Random(seed)
        # Times a pixel as measured ones spread: from the fastest to a few times that, some of them nearly alike.
        self.speed = {f"v{i}": 1e-6 * math.exp(self.chance.gauss(0.0, 0.5)) for i in range(number)}
        # What a frame costs beside its pixels, so that small images rank variants somewhat otherwise.
        self.fixed = {label: 1e-3 * self.chance.random() for label in self.speed}
        self.noise, self.drift, self.spent = noise, 0.0, 0.0
        self.wrong: dict[str, float] = {}
        self.broken: dict[str, str] = {}
        self.judged: list[tuple[str, Size]] = []

    def true(self, label: str, size: Size = SIZE) -> float:
        return self.fixed[label] + self.speed[label] * size[0] * size[1]

    def measure(self, labels: Sequence[str], size: Size) -> dict[str, float | str]:
        self.drift += self.chance.gauss(0.0, 0.1)
        return {label: self.broken.get(label) or self._time(label, size) for label in labels}

    def judge(self, label: str, size: Size) -> Judged | str:
        self.judged.append((label, size))
        rays = size[0] * size[1]
        wrong = sum(self.chance.random() < self.wrong[label] for _ in range(rays)) if label in self.wrong else 0
        return Judged(wrong / rays, rays)

    def _time(self, label: str, size: Size) -> float:
        disturbed = 1.0 + self.chance.random() if self.chance.random() < 0.05 else 1.0
        time = self.true(label, size) * math.exp(self.drift + self.chance.gauss(0.0, self.noise)) * disturbed
        self.spent += time / math.exp(self.drift)
        return time


def run(device: Device, sizes: Mapping[str, int] | None = None, memory: int | None = None) -> Verdict:
    candidates = [Candidate(label, (sizes or {}).get(label, 1000)) for label in device.speed]
    return recommend(candidates, device.measure, device.judge, Terms(SIZE, memory=memory))


@pytest.mark.parametrize("number", [12, 45, 120])
def test_the_pick_is_near_the_best_in_a_fraction_of_the_time(number: int) -> None:
    misses, shares = [], []
    for seed in SEEDS:
        device = Device(seed, number)
        found = run(device)
        assert found.pick is not None
        best = min(map(device.true, device.speed))
        if device.true(found.pick.label) > 1.05 * best:
            misses.append(seed)
        shares.append(device.spent / (12 * sum(map(device.true, device.speed))))
    assert len(misses) <= len(SEEDS) // 20, f"seeds {misses} picked one more than 5 % slower than the best"
    if number >= 45:
        assert median(shares) < 0.1


def test_hardly_anybody_near_the_best_is_called_clearly_slower() -> None:
    """What the pilot eliminates as clearly slower is: its true ratio at that size lies past the margin."""
    wrong, all_of_them = [], 0
    for seed in SEEDS:
        device = Device(seed, 45, noise=0.08)
        for gone in run(device).eliminated:
            all_of_them += 1
            if device.true(gone.label, gone.size) < device.true(gone.leader, gone.size) * (1 + MARGIN / 2):
                wrong.append((seed, gone))
    assert all_of_them > 1000
    assert len(wrong) < all_of_them / 100, wrong[:3]


def test_equals_are_not_told_apart_and_the_smaller_is_picked() -> None:
    """Three with one true time: at most 5 % of the seeds may claim a difference."""
    claims, picked = 0, []
    for seed in range(200):
        device = Device(seed, 3)
        device.speed = dict.fromkeys(device.speed, 1e-6)
        device.fixed = dict.fromkeys(device.fixed, 0.0)
        found = run(device, {"v0": 3000, "v1": 1000, "v2": 2000})
        fastest = next(one for one in found.finalists if one.label == found.fastest)
        claims += any(
            one.ratio.told_apart for one in found.finalists if found.pick is not None and found.pick is fastest
        )
        picked.append(found.pick.label if found.pick else "")
    assert claims <= 10
    assert picked.count("v1") > 120


def test_budgets_exclude_and_say_so() -> None:
    device = Device(7, 20)
    first, second = sorted(device.speed, key=device.true)[:2]
    device.wrong = {first: 0.01}
    found = run(device, {second: 10_000}, memory=5000)
    assert first in found.over_error
    assert found.over_memory == {second: 10_000}
    assert found.pick is not None
    assert found.pick.label not in (first, second)


def test_variants_that_fail_the_error_budget_eliminate_nobody() -> None:
    """The fastest half is wrong: the best of the others is found all the same."""
    misses, seeds = [], range(300)
    for seed in seeds:
        device = Device(seed, 24)
        order = sorted(device.speed, key=device.true)
        device.wrong = dict.fromkeys(order[:12], 0.02)
        found = run(device)
        assert found.pick is not None
        if device.true(found.pick.label) > 1.06 * device.true(order[12]):
            misses.append(seed)
        assert all(gone.leader not in device.wrong for gone in found.eliminated), f"seed {seed}"
    assert len(misses) <= len(seeds) // 50, f"seeds {misses} picked one more than 6 % slower than the best"


def test_whoever_is_spared_a_rung_s_last_rounds_is_far_slower() -> None:
    spared: dict[int, list[float]] = {rounds: [] for rounds in range(1, PILOT_ROUNDS)}
    for seed in SEEDS:
        device = Device(seed, 45)
        for gone in run(device).eliminated:
            if gone.rounds in spared:
                ratio = device.true(gone.label, gone.size) / device.true(gone.leader, gone.size)
                spared[gone.rounds].append(ratio)
    assert all(len(ratios) > 15 * len(SEEDS) for ratios in spared.values()), list(map(len, spared.values()))
    assert all(sum(ratio < 1 + FAR / 2 for ratio in ratios) < len(ratios) / 200 for ratios in spared.values()), list(
        map(min, spared.values())
    )


def test_the_last_rung_adds_its_rounds_to_those_of_the_one_before_at_its_size() -> None:
    device = Device(5, 12)
    device.speed = {label: 1e-6 * (1 + i / 500) for i, label in enumerate(device.speed)}
    found = run(device)
    assert found.rungs[-1].size == found.rungs[-2].size
    assert found.unconfirmed
    assert all(one.rounds == 2 * PILOT_ROUNDS for one in found.unconfirmed)


def test_only_what_leads_and_is_confirmed_is_judged_and_once_at_a_size() -> None:
    for seed in SEEDS:
        device = Device(seed, 45)
        found = run(device)
        assert len(device.judged) == len(set(device.judged)), f"seed {seed}"
        assert len(device.judged) <= 2 * len(found.rungs) + len(found.finalists), f"seed {seed}"


def test_an_error_that_only_the_full_size_shows_lets_the_next_one_in() -> None:
    device = Device(3, 8)
    best = min(device.speed, key=device.true)

    def judge(label: str, size: Size) -> Judged:
        return Judged(2e-3 if label == best and size == SIZE else 0.0, size[0] * size[1])

    found = recommend([Candidate(label, 1) for label in device.speed], device.measure, judge, Terms(SIZE))
    assert best in found.over_error
    assert len(found.finalists) > 0
    assert best not in [one.label for one in found.finalists]


def test_failures_are_told_and_cost_the_others_nothing() -> None:
    device = Device(5, 10)
    best = min(device.speed, key=device.true)
    device.broken = {best: "Its buffers are too large for this device."}
    found = run(device)
    assert found.failed == device.broken
    assert found.pick is not None
    device.broken = dict.fromkeys(device.speed, "It does not compile.")
    assert run(device).pick is None


def test_a_full_size_failure_of_all_finalists_goes_on_with_those_left() -> None:
    device = Device(11, 9, noise=0.2)
    device.speed = dict.fromkeys(device.speed, 1e-6)
    refused: set[str] = set()

    def measure(labels: Sequence[str], size: Size) -> dict[str, float | str]:
        if size == SIZE and not refused:
            refused.update(labels)
        return {
            label: "Out of memory." if size == SIZE and label in refused else outcome
            for label, outcome in device.measure(labels, size).items()
        }

    found = recommend([Candidate(label, 1) for label in device.speed], measure, device.judge, Terms(SIZE))
    assert len(refused) == 3
    assert found.pick is not None
    assert found.pick.label not in refused


def test_every_candidate_is_accounted_for_once() -> None:
    device = Device(2, 30, noise=0.1)
    order = sorted(device.speed)
    device.wrong = {order[4]: 0.05}
    device.broken = {order[5]: "No."}
    found = run(device, {order[6]: 9999}, memory=5000)
    named = [one.label for one in found.finalists]
    named += [one.label for one in (*found.eliminated, *found.unconfirmed)]
    named += [*found.over_memory, *found.over_error, *found.failed]
    assert sorted(named) == order


def test_the_noise_is_told_from_all_variants_together() -> None:
    """The error of a difference, from three rounds of many variants, is about what a thousand tries spread by."""
    chance = random.Random(1)
    errors, found = [], []
    for _ in range(300):
        drift = [chance.gauss(0, 0.3) for _ in range(3)]
        times = {f"v{i}": [math.exp(i + d + chance.gauss(0, 0.05)) for d in drift] for i in range(20)}
        standing = Standing(times)
        errors.append(standing.error)
        found.append(standing.level["v1"] - standing.level["v0"] - 1.0)
    spread = math.sqrt(sum(shift * shift for shift in found) / len(found))
    assert spread == pytest.approx(median(errors), rel=0.25)


def test_pilot_sizes_grow_and_keep_the_shape() -> None:
    assert pilot_sizes((1024, 512)) == [(256, 128), (362, 181), (512, 256), (512, 256)]
    assert pilot_sizes((256, 256))[0] == (128, 128)
    assert pilot_sizes((8, 4))[0] == (8, 4)


@pytest.mark.parametrize(("rounds", "critical"), [(6, 0), (7, 2), (8, 3), (10, 8), (15, 25), (20, 52)])
def test_the_cut_is_that_of_the_published_table(rounds: int, critical: int) -> None:
    """Critical values of T for 5 %, two-sided (Wilcoxon's signed-rank test)."""
    assert signed_rank_cut(rounds, 0.95) == critical + 1
    assert signed_rank_cut(5, 0.95) == 0


def test_the_paired_interval_is_exact_over_all_signs() -> None:
    """Of all ways to sign seven differences, at most 5 % leave out 1, and not none."""
    sizes = [0.01 * (1 + i * i) for i in range(7)]
    called = 0
    for signs in product((1, -1), repeat=7):
        second = [math.exp(sign * size) for sign, size in zip(signs, sizes, strict=True)]
        called += paired_ratio([1.0] * 7, second).told_apart
    assert 0 < called / 2**7 <= 0.05
