"""Names the fastest variant within budgets: a pilot by successive halving, then a confirmation at the size asked for.

Successive halving (Jamieson and Talwalkar, Non-stochastic Best Arm Identification and Hyperparameter Optimization,
2016) gives each rung about the same time: about two thirds go, and those that stay are measured on twice the
pixels. Nobody goes who is not clearly slower than the fastest that keeps the budgets. Every round measures all that are
left, one after the other, and only ratios within a round count. This file knows nothing of devices: whoever calls it
measures.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from statistics import NormalDist, variance

from renderer.times.difference import NEGLIGIBLE, share_interval
from renderer.times.interval import CONFIDENCE, median
from renderer.times.paired import Ratio, paired_ratio

Size = tuple[int, int]

PILOT_SHARE = 1 / 16
"""The pilot's first rung has this share of the pixels, and the last at most MOST_SHARE."""
MOST_SHARE = 1 / 4
LEAST_PIXELS = 128 * 128
PILOT_ROUNDS = 3
FINALISTS = 3
ROUNDS = 8
"""Rounds of the confirmation: enough for an interval of two comparisons that hold together with 95 % confidence."""

MARGIN = 0.10
"""Small images rank variants a little otherwise: who is behind the first third is clearly slower past this."""
FAR = 0.5
"""Clearly slower by more than this goes from the first third, too, and before a rung's last round: what is far slower
takes most of the time."""
TIE = NEGLIGIBLE / 2
"""Of those that cannot be told apart from the fastest and are estimated within this, the smallest is picked."""
LEAST_NOISE = 0.005
SUPPOSED_NOISE = 0.2
"""What a single round, which cannot tell its noise, is taken to have: what goes after it is 3.4 times as slow."""
_Z = NormalDist().inv_cdf(0.99)
_Z_SHOWN = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
_MEDIAN_TO_MEAN = 1.2533
"""The standard error of a median over that of a mean, for normal noise."""


@dataclass(frozen=True)
class Candidate:
    """A variant that can be measured; `memory` is its buffers in bytes."""

    label: str
    memory: int


@dataclass(frozen=True)
class Judged:
    """The wrong rays as a fraction of `rays`."""

    wrong: float
    rays: int


Measure = Callable[[Sequence[str], Size], Mapping[str, float | str]]
"""One round: each label's time in seconds, or in a sentence why it could not run. The order is the order to run in."""
Judge = Callable[[str, Size], Judged | str]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Terms:
    """What a recommendation keeps to: the image, the largest fraction of wrong rays, and of bytes (None: any)."""

    size: Size
    error: float = 1e-3
    memory: int | None = None
    rounds: int = ROUNDS
    seed: int = 1


@dataclass(frozen=True)
class Eliminated:
    """Who left the pilot, or was not confirmed: its time over `leader`'s with a 95 % interval, at `size`."""

    label: str
    leader: str
    ratio: float
    low: float
    high: float
    size: Size
    rounds: int


@dataclass(frozen=True)
class Rung:
    """One rung of the pilot."""

    size: Size
    measured: int
    kept: int
    rounds: int


@dataclass(frozen=True)
class Finalist:
    """One that was confirmed at the full size; `seconds` is its median time, `ratio` its time over the pick's."""

    label: str
    memory: int
    seconds: float
    judged: Judged
    ratio: Ratio


@dataclass
class Verdict:
    """What came of it, the pick first among the `finalists`; no finalist where nothing keeps the budgets and runs.

    `confidence` is that of each finalist's interval, such that all hold together with 95 %. `eliminated` were clearly
    slower; `unconfirmed` were left at the end of the pilot without being told apart from those that were confirmed.
    """

    finalists: list[Finalist] = field(default_factory=list)
    confidence: float = CONFIDENCE
    fastest: str | None = None
    rungs: list[Rung] = field(default_factory=list)
    eliminated: list[Eliminated] = field(default_factory=list)
    unconfirmed: list[Eliminated] = field(default_factory=list)
    over_memory: dict[str, int] = field(default_factory=dict)
    over_error: dict[str, Judged] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def pick(self) -> Finalist | None:
        """The variant to take."""
        return self.finalists[0] if self.finalists else None


def recommend(
    candidates: Sequence[Candidate], measure: Measure, judge: Judge, terms: Terms, tell: Tell = lambda _: None
) -> Verdict:
    """Find the fastest candidate that keeps the terms; labels are unique."""
    return _Search(candidates, measure, judge, terms, tell).run()


class _Search:
    def __init__(
        self, candidates: Sequence[Candidate], measure: Measure, judge: Judge, terms: Terms, tell: Tell
    ) -> None:
        self.memory = {one.label: one.memory for one in candidates}
        self.measure, self.judge, self.terms, self.tell = measure, cache(judge), terms, tell
        self.chance = random.Random(terms.seed)
        self.verdict = Verdict()

    def run(self) -> Verdict:
        found, most = self.verdict, self.terms.memory
        found.over_memory = {label: n for label, n in self.memory.items() if most is not None and n > most}
        alive = [label for label in self.memory if label not in found.over_memory]
        standing: dict[str, Eliminated] = {}
        times: dict[str, list[float]] = {}
        measured_at: Size | None = None
        for size in pilot_sizes(self.terms.size):
            if len(alive) <= FINALISTS:
                break
            before: dict[str, list[float]] = {label: times[label] if size == measured_at else [] for label in alive}
            alive, standing, times = self._rung(before, size)
            measured_at = size
        self._confirm(alive, standing)
        return found

    # The pilot

    def _rung(
        self, times: dict[str, list[float]], size: Size
    ) -> tuple[list[str], dict[str, Eliminated], dict[str, list[float]]]:
        """Who is left after one rung, the fastest first, how each of them stood, and their times at this size."""
        entered = len(times)
        self.tell(f"{entered} variants at {size[0]}x{size[1]}")
        third = max(FINALISTS, math.ceil(entered / 3))
        for left in reversed(range(PILOT_ROUNDS)):
            times = self._round(times, size)
            standing = Standing(times)
            if left and not standing.is_any_slower(FAR):
                continue
            kept = self._sift(standing, size, len(times) if left else third)
            times = {label: times[label] for label in kept}
        self.verdict.rungs.append(Rung(size, entered, len(kept), PILOT_ROUNDS))
        return kept, {label: standing.against(label, kept[0], size) for label in kept}, times

    def _sift(self, standing: Standing, size: Size, faster: int) -> list[str]:
        """Who is not clearly slower than the fastest that keeps the error budget, by FAR among the first `faster`."""
        kept: list[str] = []
        for label in standing.order:
            margin = MARGIN if len(kept) >= faster else FAR
            if kept and standing.is_slower(label, kept[0], margin):
                self.verdict.eliminated.append(standing.against(label, kept[0], size))
            elif kept or self._passes(label, size):
                kept.append(label)
        return kept

    def _round(self, before: Mapping[str, list[float]], size: Size) -> dict[str, list[float]]:
        """The times `before` and of one round more, of those that ran in every round."""
        times = {label: list(own) for label, own in before.items()}
        order = list(times)
        self.chance.shuffle(order)
        for label, outcome in self.measure(order, size).items():
            if isinstance(outcome, str):
                self.verdict.failed[label] = outcome
                times.pop(label)
            else:
                times[label].append(outcome)
        return times

    def _passes(self, label: str, size: Size) -> bool:
        """Whether a variant keeps the error budget, as one does that may keep it on more rays."""
        outcome = self.judge(label, size)
        if isinstance(outcome, str):
            self.verdict.failed[label] = outcome
            return False
        least = outcome.wrong
        if outcome.rays:
            least = share_interval(round(outcome.wrong * outcome.rays), outcome.rays)[0]
        if least <= self.terms.error:
            return True
        self.verdict.over_error[label] = outcome
        return False

    # The confirmation

    def _confirm(self, alive: Sequence[str], standing: Mapping[str, Eliminated]) -> None:
        """Measure the first of those that are left side by side at the full size."""
        chosen: list[str] = []
        judged: dict[str, Judged] = {}
        waiting = list(alive)
        while waiting and len(chosen) < FINALISTS:
            label = waiting.pop(0)
            self.tell(f"judging {label} at {self.terms.size[0]}x{self.terms.size[1]}")
            outcome = self.judge(label, self.terms.size)
            if isinstance(outcome, str):
                self.verdict.failed[label] = outcome
            elif outcome.wrong > self.terms.error:
                self.verdict.over_error[label] = outcome
            else:
                chosen.append(label)
                judged[label] = outcome
        self.tell(f"{len(chosen)} variants at {self.terms.size[0]}x{self.terms.size[1]}")
        times: dict[str, list[float]] = {label: [] for label in chosen}
        for _ in range(self.terms.rounds):
            times = self._round(times, self.terms.size)
        if not times and waiting:
            self._confirm(waiting, standing)
            return
        self.verdict.unconfirmed = [standing[label] for label in waiting if label in standing]
        if times:
            self._decide(times, judged)

    def _decide(self, times: Mapping[str, list[float]], judged: Mapping[str, Judged]) -> None:
        found = self.verdict
        found.confidence = 1 - (1 - CONFIDENCE) / max(1, len(times) - 1)
        fastest = min(times, key=lambda label: median([math.log(time) for time in times[label]]))
        near = [fastest]
        for label in times:
            ratio = paired_ratio(times[fastest], times[label], found.confidence)
            if label != fastest and not ratio.told_apart and ratio.ratio <= 1 + TIE:
                near.append(label)
        pick = min(near, key=lambda label: (self.memory[label], label != fastest))
        finalists = [
            Finalist(
                label,
                self.memory[label],
                median(times[label]),
                judged[label],
                paired_ratio(times[pick], times[label], found.confidence),
            )
            for label in times
        ]
        found.fastest = fastest
        found.finalists = sorted(finalists, key=lambda one: (one.label != pick, one.ratio.ratio))


class Standing:
    """How variants stand to each other after a few rounds that each measured all of them.

    A round's and a variant's log time add up, but for noise of one size for all: three rounds of one variant alone
    could not tell it, so it is the median of all variants' standard deviations over the rounds, which neighbours that
    disturb a round of some of them hardly change.
    """

    def __init__(self, times: Mapping[str, Sequence[float]]) -> None:
        """Fit the times, (rounds,) each."""
        logs = {label: [math.log(time) for time in own] for label, own in times.items()}
        self.rounds = min((len(own) for own in logs.values()), default=0)
        rounds = range(self.rounds)
        typical = {label: median(own) for label, own in logs.items()}
        drift = [median([own[i] - typical[label] for label, own in logs.items()]) for i in rounds]
        self.steady = {label: [own[i] - drift[i] for i in rounds] for label, own in logs.items()}
        self.level = {label: median(own) for label, own in self.steady.items()}
        self.order = sorted(self.level, key=self.level.__getitem__)
        free = self.rounds - 1
        noise = SUPPOSED_NOISE
        if free > 0:
            # The median of a chi-squared variable, by Wilson and Hilferty's approximation.
            typical_variance = (1 - 2 / (9 * free)) ** 3
            noise = math.sqrt(median([variance(own) for own in self.steady.values()]) / typical_variance)
            # The drift was fitted, too.
            noise *= math.sqrt(len(logs) / max(1, len(logs) - 1))
        # The error of the difference of two medians over the rounds.
        self.error = max(LEAST_NOISE, noise) * _MEDIAN_TO_MEAN * math.sqrt(2 / max(1, self.rounds))

    def is_slower(self, label: str, leader: str, margin: float) -> bool:
        """Whether it is slower by more than `margin`: with 99 % confidence, and in every round.

        The latter is for neighbours that disturbed most rounds of one variant.
        """
        shift, least = self.level[label] - self.level[leader], math.log1p(margin)
        pairs = zip(self.steady[label], self.steady[leader], strict=True)
        return shift - _Z * self.error > least and all(mine - theirs > least for mine, theirs in pairs)

    def is_any_slower(self, margin: float) -> bool:
        """Whether any is slower than the fastest of all."""
        return any(self.is_slower(label, self.order[0], margin) for label in self.order)

    def against(self, label: str, leader: str, size: Size) -> Eliminated:
        """The ratio to the leader with its 95 % interval."""
        shift, reach = self.level[label] - self.level[leader], _Z_SHOWN * self.error
        low, high = math.exp(shift - reach), math.exp(shift + reach)
        return Eliminated(label, leader, math.exp(shift), low, high, size, self.rounds)


def pilot_sizes(size: Size) -> list[Size]:
    """The sizes of the pilot's rungs: of the same shape, each with twice the pixels of the one before.

    The last is measured twice, and the second time adds to the first.
    """
    sizes: list[Size] = []
    share = PILOT_SHARE
    while True:
        scale = math.sqrt(min(1.0, max(share, LEAST_PIXELS / (size[0] * size[1]))))
        sizes.append((max(1, round(size[0] * scale)), max(1, round(size[1] * scale))))
        if share >= MOST_SHARE:
            return [*sizes, sizes[-1]]
        share *= 2
