"""The time left, on farms that are made up: what is told while they work against what they then took."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import pytest

from server.live.time_left import FIRST_TO_LATER, JobTimes, seconds_left, write_left


@dataclass(eq=False)
class FarmJob:
    """A job whose first round takes `first` seconds and each of `rounds - 1` others `later`."""

    device: str
    scene: str
    first: float
    later: list[float]
    ended: list[float] = field(default_factory=list)

    def times(self) -> JobTimes:
        done, later_done = len(self.ended), self.ended[1:]
        return JobTimes(
            self.device,
            self.scene,
            self.ended[0] if done else None,
            sum(later_done) / len(later_done) if later_done else None,
            int(done == 0),
            len(self.later) - len(later_done),
        )

    def rest(self) -> float:
        return sum([self.first, *self.later][len(self.ended) :])


def make_farm(seed: int, noise: float) -> list[FarmJob]:
    """Three devices of different speeds, scenes of different weight, variants that differ, and a ratio of its own."""
    chance = random.Random(seed)
    ratio = chance.uniform(1.0, 4.0)
    speeds = {device: chance.uniform(0.5, 3.0) for device in ("llvmpipe", "phone", "old phone")}
    weights = {scene: chance.uniform(1.0, 10.0) for scene in ("box", "forest", "hall")}
    jobs = []
    for device, speed in speeds.items():
        for scene, weight in weights.items():
            for _ in range(8):
                cost = speed * weight * chance.uniform(0.8, 1.25)
                later = [cost * (1 + noise * chance.uniform(-1, 1)) for _ in range(3)]
                jobs.append(FarmJob(device, scene, cost * ratio, later))
    return jobs


def work(jobs: list[FarmJob], seconds: float) -> None:
    """Let every device work for a time, round after round, each on one slice at a time."""
    for device in {job.device for job in jobs}:
        own = [job for job in jobs if job.device == device]
        clock = 0.0
        for index in range(4):
            for job in own:
                clock += [job.first, *job.later][index]
                if clock > seconds:
                    break
                job.ended.append([job.first, *job.later][index])


def told(jobs: list[FarmJob]) -> float | None:
    return seconds_left([job.times() for job in jobs], {})


def truth(jobs: list[FarmJob]) -> float:
    return max(sum(job.rest() for job in jobs if job.device == device) for device in {job.device for job in jobs})


@pytest.mark.parametrize("seed", range(8))
def test_what_is_told_is_near_what_it_takes(seed: int) -> None:
    whole = truth(make_farm(seed, noise=0.2))
    for share in (0.7, 0.8, 0.9, 0.97):
        jobs = make_farm(seed, noise=0.2)
        work(jobs, whole * share)
        left = told(jobs)
        assert left is not None
        assert left == pytest.approx(truth(jobs), rel=0.2), share


@pytest.mark.parametrize("seed", range(4))
def test_without_noise_it_is_exact_once_every_job_has_both_rounds(seed: int) -> None:
    jobs = make_farm(seed, noise=0.0)
    for job in jobs:
        job.ended = [job.first, job.later[0]]
    assert told(jobs) == pytest.approx(truth(jobs))


@pytest.mark.parametrize("seed", range(4))
def test_jobs_that_were_not_seen_cost_what_their_scene_does(seed: int) -> None:
    """All but one job of each scene on each device are alike and seen: the ratio is known, the unseen is like them."""
    chance = random.Random(seed)
    jobs, unseen = [], []
    for device in ("a", "b"):
        for scene in ("box", "forest"):
            cost = chance.uniform(1, 20)
            jobs += [FarmJob(device, scene, cost * 2.5, [cost] * 2) for _ in range(4)]
            unseen.append(jobs[-1])
    for job in jobs:
        job.ended = [] if job in unseen else [job.first, job.later[0]]
    assert told(jobs) == pytest.approx(truth(jobs))


def test_in_the_first_round_later_ones_are_taken_to_cost_less() -> None:
    jobs = [JobTimes("a", "box", 4.0, None, 0, 3), JobTimes("a", "box", None, None, 1, 3)]
    later = 4.0 / FIRST_TO_LATER
    assert seconds_left(jobs, {}) == pytest.approx(later * 3 + 4.0 + later * 3)


def test_before_it_can_know_it_says_nothing() -> None:
    waiting = JobTimes("a", "box", None, None, 1, 3)
    assert seconds_left([waiting], {}) is None
    assert seconds_left([], {}) == 0
    assert seconds_left([waiting, JobTimes("b", "forest", 2.0)], {}) == pytest.approx(2.0 + 3 * 2.0 / FIRST_TO_LATER)


def test_a_device_that_is_away_makes_it_unknown_and_a_pool_shares() -> None:
    jobs = [JobTimes("pool", "box", 4.0, 2.0, 0, 6), JobTimes("phone", "box", 1.0, 1.0, 0, 2)]
    assert seconds_left(jobs, {"pool": 3, "phone": 1}) == 4.0
    assert seconds_left(jobs, {"pool": 3, "phone": 0}) is None
    assert seconds_left([jobs[0], JobTimes("phone", "box", 1.0, 1.0)], {"phone": 0}) == 12.0


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (None, None),
        (0.0, "less than a minute left"),
        (59.0, "less than a minute left"),
        (61.0, "about 1 min left"),
        (734.0, "about 12 min left"),
        (1500.0, "about 25 min left"),
        (2700.0, "about 45 min left"),
        (5399.0, "about 90 min left"),
        (5400.0, "about 1.5 h left"),
        (7300.0, "about 2 h left"),
        (86400.0, "about 24 h left"),
    ],
)
def test_words_are_coarse(seconds: float | None, words: str | None) -> None:
    assert write_left(seconds) == words
