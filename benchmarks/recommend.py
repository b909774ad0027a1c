"""Recommendations against exhaustive measurement: `python -m benchmarks.recommend [SCENE ...]`.

On each scene the recommendation is asked for, then every candidate is measured as `rayfarm bench` does, 12 frames in 4
interleaved rounds, in the same process. Prints how far the pick is from the best that the latter found, and the share
of its measuring time that the former took: timed frames against timed frames; builds, compilation and warm-up apart.
"""

from __future__ import annotations

import argparse
import random
import sys
from dataclasses import dataclass

from renderer.answering import silent
from renderer.kept_twins import KeptTwins
from renderer.recommend.halving import Terms, recommend
from renderer.recommend.pilot import Pilot
from renderer.request import Request, parse_size
from renderer.times.interval import median
from renderer.times.paired import paired_ratio
from renderer.variant import TRAVERSALS, expand, matrix
from scenes.catalogue import list_scenes

SCENES = ("cornell-box", "crytek-sponza", "conference", "forest", "happy-buddha-67k", "happy-buddha")
ROUNDS, FRAMES = 4, 3
COLUMNS = (
    "scene", "rays", "variants", "pick", "best of all", "pick / best", "share of the time", "seconds", "seconds of all",
    "judging s",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """One scene: the pick, the best, their ratio with its least and most over the rounds, and the times in seconds."""

    scene: str
    variants: int
    pick: str
    best: str
    ratio: float
    took_s: float
    all_s: float
    judging_s: float


def compared(scene: str, options: argparse.Namespace) -> Row:
    """Ask, then measure everything."""
    pilot = Pilot(_requests(scene, options), KeptTwins(1))
    candidates = pilot.candidates(silent)
    terms = Terms(options.size, error=options.error_budget, seed=options.seed)
    found = recommend(candidates, pilot.measure, pilot.judge, terms, lambda text: print(scene, text, file=sys.stderr))
    assert found.pick is not None
    took = dict(pilot.took_s)
    labels = [one.label for one in candidates if one.label not in {*found.over_error, *found.failed}]
    times = _measured_all(pilot, labels, options)
    best = min(times, key=lambda label: median(times[label]))
    return Row(
        scene,
        len(candidates),
        found.pick.label,
        best,
        paired_ratio(times[best], times[found.pick.label]).ratio,
        took["measuring"],
        pilot.took_s["measuring"] - took["measuring"],
        took["judging"],
    )


def _requests(scene: str, options: argparse.Namespace) -> list[Request]:
    walks = [name for name, row in TRAVERSALS.items() if row.structure != "none"]
    axes = {axis: expand(axis, getattr(options, axis)) for axis in ("method", "layout", "nodes", "fetch")}
    variants, _ = matrix({"traversal": walks, **axes}, options.rays)
    return [Request(scene, one, options.size, frames=1, rounds=1, rays=options.rays) for one in variants]


def _measured_all(pilot: Pilot, labels: list[str], options: argparse.Namespace) -> dict[str, list[float]]:
    """Each round's figure of each candidate at the full size; of those that ran in every round."""
    times: dict[str, list[float]] = {label: [] for label in labels}
    chance = random.Random(options.seed)
    for number in range(ROUNDS):
        print(f"all at full size, round {number + 1}/{ROUNDS}", file=sys.stderr)
        order = list(times)
        chance.shuffle(order)
        for label, outcome in pilot.measure(order, options.size, FRAMES).items():
            if isinstance(outcome, str):
                times.pop(label)
            else:
                times[label].append(outcome)
    return times


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--rays", choices=("primary", "shadow", "both"), default="primary")
    parser.add_argument("--method", default="all")
    parser.add_argument("--layout", default="normal")
    parser.add_argument("--nodes", default="all")
    parser.add_argument("--fetch", default="all")
    parser.add_argument("--error-budget", type=float, default=1e-3)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    here = {row["name"] for row in list_scenes() if row["here"]}
    print(f"{options.size[0]}x{options.size[1]}, one thread, seed {options.seed}\n")
    print("| " + " | ".join(COLUMNS) + " |\n" + "|---" * len(COLUMNS) + "|", flush=True)
    for scene in options.scenes or [name for name in SCENES if name in here]:
        row = compared(scene, options)
        print(
            f"| {scene} | {options.rays} | {row.variants} | {row.pick} | {row.best} | {row.ratio:.3f} "
            f"| {row.took_s / row.all_s:.3f} | {row.took_s:.1f} | {row.all_s:.1f} | {row.judging_s:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
