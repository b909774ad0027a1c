"""How often a device calls two measurements of one request different, and the smallest slowdown it can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import quantiles
from typing import Any

from renderer.times.difference import share_interval
from renderer.times.interval import median
from server.comparison.differences import DEFAULT_GATE, Pair, environment_of, pair_of, setup_of

Json = dict[str, Any]


@dataclass(frozen=True)
class Share:
    """A count of tries with the 95 % interval of its share."""

    found: int
    tries: int
    low: float
    high: float


@dataclass(frozen=True)
class FalseAlarms:
    """A device's pairs of one request with itself.

    `differing` were called faster or slower, `stopped` would have stopped a gate at its default. `visible` is the
    median of the pairs' smallest visible slowdown, `visible_worst` what 9 of 10 pairs could show; both are fractions,
    None where no pair has rounds enough for an interval. `load` is the median load average.
    """

    setup: dict[str, str]
    environment: dict[str, str]
    clock: str
    rounds: int
    differing: Share
    stopped: Share
    visible: float | None
    visible_worst: float | None
    load: float | None


def count_alarms(results: Sequence[Json]) -> list[FalseAlarms]:
    """Pair the results of each set-up by twos, in their order, and count; what has no partner is left out."""
    groups: dict[tuple[str, ...], list[Json]] = {}
    for result in results:
        key = (*setup_of(result).values(), *environment_of(result).values())
        groups.setdefault(key, []).append(result)
    return [_count(group) for group in groups.values() if len(group) > 1]


def _count(results: Sequence[Json]) -> FalseAlarms:
    pairs = [pair_of(results[i], results[i + 1]) for i in range(0, len(results) - 1, 2)]
    seen = sorted(pair.difference.visible for pair in pairs if pair.difference.visible is not None)
    loads = [float(result["load_average"]) for result in results if result.get("load_average") is not None]
    return FalseAlarms(
        setup=setup_of(results[0]),
        environment=environment_of(results[0]),
        clock=pairs[0].clock,
        rounds=min(min(pair.difference.rounds) for pair in pairs),
        differing=_share(pairs, sum(pair.difference.verdict in ("faster", "slower") for pair in pairs)),
        stopped=_share(pairs, sum(pair.difference.is_slower_by(DEFAULT_GATE) for pair in pairs)),
        visible=median(seen) if seen else None,
        visible_worst=quantiles(seen, n=10, method="inclusive")[-1] if len(seen) > 1 else None,
        load=median(loads) if loads else None,
    )


def _share(pairs: Sequence[Pair], found: int) -> Share:
    return Share(found, len(pairs), *share_interval(found, len(pairs)))
