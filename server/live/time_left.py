"""How long a study still takes, told from how long its slices took so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import fmean

MINUTE_S = 60.0
HOUR_S = 3600.0
FIRST_TO_LATER = 2.0
"""What a first round costs, in later ones, until a study tells its own; on llvmpipe 1.2 to 3 were measured."""


@dataclass(frozen=True)
class JobTimes:
    """One job, or several alike: mean seconds of ended slices, and how many are open.

    The first round and later ones are apart, because the first one judges.
    """

    device: str
    scene: str
    first_s: float | None = None
    later_s: float | None = None
    first_open: int = 0
    later_open: int = 0


def seconds_left(jobs: Iterable[JobTimes], devices: Mapping[str, int]) -> float | None:
    """The seconds until all open slices have ended; None before it can be known.

    `devices` says how many of a device's slices run side by side: 0 while it is away, 1 where it is not named. Devices
    run side by side, so it is the slowest one's sum. A job's slices cost what its own ones did, and a job that has none
    costs what those of its scene, or else all of the study did, on its device if possible. What a first round costs
    more than a later one is learned from the jobs that have both.
    """
    known = list(jobs)
    waiting = [job for job in known if job.first_open or job.later_open]
    ratio = _ratio(known)
    costs = _later_costs(known, ratio)
    sums: dict[str, float] = defaultdict(float)
    for job in waiting:
        later = _expected(job, ratio, costs)
        if later is None or devices.get(job.device, 1) == 0:
            return None
        sums[job.device] += later * (job.later_open + ratio * job.first_open)
    return max((total / devices.get(device, 1) for device, total in sums.items()), default=0.0)


def write_left(seconds: float | None) -> str | None:
    """The time left in words; None for None."""
    return None if seconds is None else f"{write_time(seconds)} left"


def write_time(seconds: float) -> str:
    """A time in words, no finer than a time that is left can be known."""
    minutes = round(seconds / MINUTE_S)
    if seconds < MINUTE_S:
        return "less than a minute"
    if minutes <= 20:
        return f"about {minutes} min"
    if seconds < 1.5 * HOUR_S:
        return f"about {round(minutes / 5) * 5} min"
    return f"about {round(seconds / HOUR_S * 2) / 2:g} h"


def _ratio(jobs: Iterable[JobTimes]) -> float:
    """What a first round costs, in later ones of the same job."""
    both = [(job.first_s, job.later_s) for job in jobs if job.first_s is not None and job.later_s is not None]
    later = sum(mean for _, mean in both)
    first = sum(seconds for seconds, _ in both)
    return first / later if first > 0 and later > 0 else FIRST_TO_LATER


def _own_cost(job: JobTimes, ratio: float) -> float | None:
    """The seconds of a later round of the job, as far as its own slices tell."""
    if job.later_s is not None or job.first_s is None:
        return job.later_s
    return job.first_s / ratio


def _later_costs(jobs: Iterable[JobTimes], ratio: float) -> dict[tuple[str | None, str | None], float]:
    """The mean cost of a later round by device and scene; None stands for all of them."""
    found: dict[tuple[str | None, str | None], list[float]] = defaultdict(list)
    for job in jobs:
        cost = _own_cost(job, ratio)
        if cost is not None:
            for key in ((job.device, job.scene), (job.device, None), (None, job.scene), (None, None)):
                found[key].append(cost)
    return {key: fmean(costs) for key, costs in found.items()}


def _expected(job: JobTimes, ratio: float, costs: Mapping[tuple[str | None, str | None], float]) -> float | None:
    own = _own_cost(job, ratio)
    if own is not None:
        return own
    nearest = ((job.device, job.scene), (job.device, None), (None, job.scene), (None, None))
    return next((costs[key] for key in nearest if key in costs), None)
