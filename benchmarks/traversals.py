"""All traversals beside embreex and `bvh-stack`: `python -m benchmarks.traversals [SCENE ...]`.

One thread, rounds interleaved, every slice in a process of its own; ratios are per CPU-second and taken within one
run: to embreex frame by frame over the same rays, to `bvh-stack` round by round. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from statistics import median
from typing import Any

from renderer.bench import run_slice
from renderer.request import Request, parse_size
from renderer.variant import TRAVERSALS, Variant
from scenes.catalogue import list_scenes

SCENES = ("cornell-box", "crytek-sponza", "conference", "forest", "cornell-buddha", "happy-buddha")
COLUMNS = (
    "scene", "method", "traversal", "Mrays/CPU-s", "to embreex", "to bvh-stack", "nodes/ray", "triangles/ray", "MB",
    "wrong", "edge", "shadow mismatch",
)  # fmt: skip
Rounds = dict[str, list[dict[str, Any]]]


def measured(scene: str, method: str, options: argparse.Namespace) -> Rounds:
    """Every round of every traversal, in turn."""
    rounds: Rounds = defaultdict(list)
    for index in range(options.rounds):
        for traversal in TRAVERSALS:
            if TRAVERSALS[traversal].structure == "none":
                continue
            request = Request(
                scene,
                Variant(traversal, method),
                options.size,
                frames=options.rounds * options.frames,
                rounds=options.rounds,
                rays=options.rays,
                vs_embree=True,
            )
            print(f"{scene} {method} {traversal} {index + 1}/{options.rounds}", file=sys.stderr)
            rounds[traversal].append(run_slice(request, index))
    return rounds


def ratios(rounds: Rounds, traversal: str) -> tuple[list[float], list[float]]:
    """To embreex, frame by frame, and to `bvh-stack`, round by round."""
    embree = [
        theirs / ours
        for run in rounds[traversal]
        for ours, theirs in zip(run["frames"]["cpu"], run["embree_cpu"], strict=True)
    ]
    stack = [
        median(base["frames"]["cpu"]) / median(run["frames"]["cpu"])
        for base, run in zip(rounds["bvh-stack"], rounds[traversal], strict=True)
    ]
    return embree, stack


def spread(values: list[float]) -> str:
    return f"{median(values):.2f} ({min(values):.2f}–{max(values):.2f})"


def report(scene: str, method: str, rounds: Rounds, rays: str) -> None:
    """One row a traversal."""
    for traversal, runs in rounds.items():
        first = runs[0]
        count = sum(first["rays"].values()) if rays == "both" else first["rays"][rays]
        speed = count / median([time for run in runs for time in run["frames"]["cpu"]]) / 1e6
        embree, stack = ratios(rounds, traversal)
        per_ray, error = first["per_ray"], first["error"]
        wrong = sum(error[name] or 0.0 for name in ("false_hit", "false_miss", "wrong_primitive"))
        print(
            f"| {scene} | {method} | {traversal} | {speed:.2f} | {spread(embree)} | {spread(stack)} "
            f"| {per_ray['nodes']:.1f} | {per_ray['triangles']:.1f} | {first['structure_bytes'] / 1e6:.2f} "
            f"| {wrong:.1e} | {error['edge'] or 0.0:.1e} | {error['shadow_mismatch'] or 0.0:.1e} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--rays", choices=("primary", "shadow", "both"), default="primary")
    parser.add_argument("--methods", default="fragment")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--frames", type=int, default=3, help="a round")
    options = parser.parse_args()
    here = {row["name"] for row in list_scenes() if row["here"]}
    print(f"{options.rays} rays, {options.size[0]}x{options.size[1]}, one thread: median (least–most)\n")
    print(
        "| scene | method | traversal | Mrays/CPU-s | to embreex | to bvh-stack | nodes/ray | triangles/ray | MB ",
        end="",
    )
    print("| wrong | edge | shadow mismatch |\n" + "|---" * 12 + "|")
    for scene in options.scenes or [name for name in SCENES if name in here]:
        for method in options.methods.split(","):
            report(scene, method, measured(scene, method, options), options.rays)


if __name__ == "__main__":
    main()
