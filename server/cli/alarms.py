"""The study `aa` in the terminal: a device's false alarms, and the smallest slowdown that it can show."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import typer

from server.cli.common import ClientError, print_json
from server.comparison.false_alarms import FalseAlarms, Share, count_alarms
from server.comparison.figures import write_percent

SAME = "aa"
"""The study that measures one request against itself."""


def show_alarms(results: list[dict[str, Any]], as_json: bool) -> None:
    """Print the false alarms of each device; raise ClientError where there is no pair."""
    counted = count_alarms(results)
    if not counted:
        raise ClientError("There are no two results of one request to compare: give --repeats 2 or more.")
    if as_json:
        print_json({"devices": [asdict(alarms) for alarms in counted]})
        return
    for alarms in counted:
        typer.echo("\n".join(_lines(alarms)))


def _lines(alarms: FalseAlarms) -> list[str]:
    environment, setup = alarms.environment, alarms.setup
    clock = "processor time of the fastest frame" if alarms.clock == "cpu" else "wall time of the median frame"
    load = "" if alarms.load is None else f", load average {alarms.load:.1f}"
    return [
        f"{environment['name']} ({environment['driver']}){load}",
        f"{setup['scene']}, {setup['traversal']}, {setup['size']}, against itself: {alarms.differing.tries} pairs of "
        f"{alarms.rounds} rounds, {clock} of each round",
        f"  called different: {_share(alarms.differing)}; 5 % are expected at most",
        f"  would stop a gate: {_share(alarms.stopped)}",
        *_visible(alarms),
    ]


def _share(share: Share) -> str:
    interval = f"{write_percent(share.low)} to {write_percent(share.high)}"
    return f"{share.found} of {share.tries} ({write_percent(share.found / share.tries)}, 95 % interval {interval})"


def _visible(alarms: FalseAlarms) -> list[str]:
    if alarms.visible is None:
        return ["  smallest visible slowdown: none, it takes at least 4 rounds: give --rounds 10"]
    worst = "" if alarms.visible_worst is None else f", {write_percent(alarms.visible_worst)} in 9 of 10 pairs"
    return [f"  smallest visible slowdown: {write_percent(alarms.visible)} in a usual pair{worst}"]
