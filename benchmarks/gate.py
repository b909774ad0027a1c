"""False alarms of one request against itself, and planted slowdowns found, on this machine as it is.

`python -m benchmarks.gate [--pairs 40] [--tries 10] [--rounds 20]`: the pairs of `rayfarm study aa`; the same with each
second side's times 10 % longer; and a real slowdown, an image with 11 % more pixels.
"""

from __future__ import annotations

import argparse
from typing import Any

from renderer.bench import Result, run_jobs
from renderer.request import Request
from renderer.times.difference import share_interval
from server.cli.alarms import show_alarms
from server.comparison.differences import DEFAULT_GATE, Pair, pair_of

SCENE, SIZE, LARGER, FRAMES = "cornell-box", (64, 64), (64, 71), 9


def measure(sizes: list[tuple[int, int]], rounds: int) -> list[Result]:
    """One result for each size, their rounds interleaved."""
    requests = [Request(SCENE, size=size, frames=FRAMES * rounds, rounds=rounds, check="none") for size in sizes]
    measured = run_jobs(requests, lambda request, index: None)
    failed = [result for result in measured if not isinstance(result, dict)]
    if failed:
        raise failed[0]
    return [result for result in measured if isinstance(result, dict)]


def slowed(result: dict[str, Any], factor: float) -> dict[str, Any]:
    """The result with all its times longer."""
    names = ("frames_ms", "frames_cpu_ms")
    return result | {name: [time * factor for time in result[name]] for name in names}


def by_twos(results: list[Result], factor: float = 1.0) -> list[Pair]:
    return [pair_of(results[i], slowed(results[i + 1], factor)) for i in range(0, len(results) - 1, 2)]


def report(name: str, pairs: list[Pair]) -> None:
    """One line: how many were called slower, and what the intervals were like."""
    found = sum(pair.difference.verdict == "slower" for pair in pairs)
    stopped = sum(pair.difference.is_slower_by(DEFAULT_GATE) for pair in pairs)
    low, high = share_interval(found, len(pairs))
    ratios = sorted(pair.difference.ratio for pair in pairs)
    print(f"{name}: found {found} of {len(pairs)} ({low:.0%} to {high:.0%}), gate stopped {stopped}, ", end="")
    print(f"ratios {ratios[0]:.3f} to {ratios[-1]:.3f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--tries", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=20)
    options = parser.parse_args()
    if options.pairs:
        same = measure([SIZE] * 2 * options.pairs, options.rounds)
        show_alarms(same, as_json=False)
        report("10 % planted", by_twos(same, 1.1))
    if options.tries:
        report("11 % more pixels", by_twos(measure([SIZE, LARGER] * options.tries, options.rounds)))


if __name__ == "__main__":
    main()
