"""How cost grows with the scene and with the image: `python -m benchmarks.growth [--plot FILE]`.

The statue in the Cornell box and the forest are made with 10^3 (the forest with 4 000) to 10^6 triangles and rendered
at 512x512; one of each is rendered from 128^2 to 2048^2 pixels. Primary rays, processor seconds with one thread, the
median of interleaved rounds. Prints tables in Markdown with the power p fitted to each line (time = c n^p), and draws.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np

from renderer.answering import silent
from renderer.build.cache import Kind
from renderer.build.make import build_uncached, compile_builder
from renderer.build.tree import Builder, Floats, SahCosts
from renderer.kept_twins import KeptTwins
from renderer.recommend.pilot import Pilot
from renderer.request import Request
from renderer.variant import Variant
from scenes.load import load

VARIANTS = (
    Variant("bvh-stack", "compute", nodes="grid16", fetch="image"),
    Variant("bvh-skip-octants", "compute", nodes="grid16", fetch="image"),
    Variant("bvh4-stack", "compute", nodes="quant8", fetch="image"),
    Variant("bvh-packet-4x2", "compute", nodes="grid16", fetch="image"),
    Variant("bvh-packet-skip-4x2", "compute", nodes="grid16", fetch="image"),
    Variant("bvh-restart-trail", "compute", fetch="image"),
    Variant("kd-push-down", "compute", fetch="image"),
)
BUILDS: tuple[tuple[Kind, Builder], ...] = (
    ("bvh", "sah"),
    ("bvh", "binned"),
    ("bvh", "sbvh-reinserted"),
    ("kd", "sah"),
)
TRIANGLES = (1_000, 4_000, 16_000, 64_000, 256_000, 1_000_000)
SIDES = (128, 256, 512, 1024, 2048)
SIZED = 64_000
SIDE = 512
COSTS = SahCosts(1.0, 1.0)
Points = dict[float, float]


@dataclass
class Chart:
    """Lines over one quantity: seconds or bytes by the line's name and the quantity."""

    title: str
    across: str
    up: str
    lines: dict[str, Points] = field(default_factory=lambda: defaultdict(dict))


def exponent(points: Points) -> float:
    """The power p of y = c x^p, fitted to the logarithms."""
    x, y = np.log(list(points)), np.log(list(points.values()))
    return float(np.polyfit(x, y, 1)[0])


def frames(scene: str, sides: Sequence[int], rounds: int) -> dict[tuple[str, int], float]:
    """Median seconds a frame by variant and side; variants take turns."""
    requests = [Request(scene, one, frames=1, rounds=1, rays="primary", costs=COSTS) for one in VARIANTS]
    pilot = Pilot(requests, KeptTwins(1))
    labels = [one.label for one in pilot.candidates(silent)]
    found: dict[tuple[str, int], list[float]] = defaultdict(list)
    chance = random.Random(1)
    for side in sides:
        for _ in range(rounds):
            chance.shuffle(labels)
            for label, seconds in pilot.measure(labels, (side, side)).items():
                if isinstance(seconds, str):
                    print(f"{scene}, {label}: {seconds}", file=sys.stderr)
                else:
                    found[label, side].append(seconds)
    return {key: median(values) for key, values in found.items()}


def by_triangles(family: str, rounds: int) -> list[Chart]:
    """Time of a ray, and of builds, over triangles."""
    rays = Chart(f"{family}: a primary ray at {SIDE}x{SIDE}", "triangles", "microseconds")
    builds = Chart(f"{family}: a build", "triangles", "seconds")
    for wanted in TRIANGLES:
        name = f"{family}:{max(wanted, 4_000) if family == 'forest' else wanted}"
        scene = load(name)
        count = len(scene.faces)
        print(name, file=sys.stderr)
        for (label, _), seconds in frames(name, [SIDE], rounds).items():
            rays.lines[label][count] = seconds / SIDE**2 * 1e6
        for kind, builder in BUILDS:
            builds.lines[f"{kind} {builder}"][count] = build_seconds(scene.triangles, kind, builder)
    return [rays, builds]


def build_seconds(triangles: Floats, kind: Kind, builder: Builder) -> float:
    """CPU seconds of a build with one thread."""
    os.environ["RAYFARM_BUILD_THREADS"] = "1"
    begun = time.process_time()
    build_uncached(triangles, kind, builder, COSTS)
    return time.process_time() - begun


def by_pixels(family: str, rounds: int) -> Chart:
    """Time of a frame over pixels."""
    chart = Chart(f"{family}:{SIZED}: a frame of primary rays", "pixels", "milliseconds")
    for (label, side), seconds in frames(f"{family}:{SIZED}", SIDES, rounds).items():
        chart.lines[label][side**2] = seconds * 1e3
    return chart


def table(chart: Chart) -> str:
    """A row a line, with its power."""
    places = sorted({place for points in chart.lines.values() for place in points})
    lines = [f"{chart.title}, {chart.up} by {chart.across}", ""]
    lines.append("| | " + " | ".join(f"{place:,}" for place in places) + " | power |")
    lines.append("|---" * (len(places) + 2) + "|")
    for name, points in chart.lines.items():
        cells = [f"{points[place]:.3g}" if place in points else "–" for place in places]
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {exponent(points):.2f} |")
    return "\n".join(lines)


def draw(charts: Sequence[Chart], path: Path) -> None:
    """All charts beside each other, logarithmic, each line with its fitted power."""
    from matplotlib.figure import Figure

    columns = 3
    rows = -(-len(charts) // columns)
    figure = Figure(figsize=(4.6 * columns, 5.0 * rows), layout="constrained")
    for chart, axes in zip(charts, figure.subplots(rows, columns, squeeze=False).flat, strict=False):
        for name, points in chart.lines.items():
            ordered = sorted(points.items())
            axes.loglog(*zip(*ordered, strict=True), marker="o", ms=3, lw=1.2, label=f"{name}, {exponent(points):.2f}")
        axes.set(title=chart.title, xlabel=chart.across, ylabel=chart.up)
        axes.grid(visible=True, which="major", alpha=0.3)
        axes.legend(
            fontsize=7, title="line and its power", title_fontsize=7, loc="upper left", bbox_to_anchor=(0, -0.16)
        )
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--families", default="cornell-statue,forest")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--plot", type=Path, metavar="FILE")
    options = parser.parse_args()
    for kind, builder in BUILDS:
        compile_builder(kind, builder)
    charts: list[Chart] = []
    for family in options.families.split(","):
        charts += [*by_triangles(family, options.rounds), by_pixels(family, options.rounds)]
    print("\n\n".join(table(chart) for chart in charts))
    if options.plot is not None:
        draw(charts, options.plot)


if __name__ == "__main__":
    main()
