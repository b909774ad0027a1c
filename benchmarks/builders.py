"""Builders beside embreex's, interleaved in one run: `python -m benchmarks.builders [SCENE ...]`.

Without a scene the catalogue's Sponza, Conference and Buddha are measured. A build starts from the triangles, as
embreex's mesh object does: bounds, and padding for the KD-tree, are in it; compilation is not. Prints tables in
Markdown: CPU seconds with one thread, their ratio to embreex's mesh and commit, wall seconds with one thread and with
two, what the trees are worth, and for each triangle the entries in leaves and the bytes by which resident memory grew
at most while the tree was built.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from renderer.build.api import BUILDERS
from renderer.build.cache import Kind
from renderer.build.epo import epo
from renderer.build.make import build_uncached, compile_builder
from renderer.build.tree import Builder, Bvh, SahCosts, Tree
from scenes.load import load
from scenes.scene import Scene

COSTS = {"paper": SahCosts(3.0, 1.5), "plain": SahCosts(1.0, 1.0)}
SCENES = ("crytek-sponza", "conference", "happy-buddha")
THREADS = (1, 2)
BUILDS: dict[str, tuple[Kind, Builder]] = {
    f"{kind} {builder}": (kind, builder) for kind, builders in BUILDERS.items() for builder in builders
}
Seconds = tuple[float, float]
Round = dict[tuple[str, int], Seconds]
"""Seconds are CPU and wall; a round has them by builder and threads."""


def timed(task: Callable[[], Any]) -> tuple[Seconds, Any]:
    wall, cpu = time.perf_counter(), time.process_time()
    made = task()
    return (time.process_time() - cpu, time.perf_counter() - wall), made


def embree(given: Scene) -> None:
    """embreex's mesh object, in its faster form, and its commit, which the first ray sets off."""
    scene = EmbreeScene()
    mesh = TriangleMesh(scene, given.vertices, given.faces)
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    del mesh


def one_round(scene: Scene, names: list[str], costs: SahCosts) -> tuple[Round, dict[str, Tree]]:
    """Everything once, in turn, so that drift of the machine hits all alike."""
    found: Round = {}
    trees: dict[str, Tree] = {}
    found["embreex", 1], _ = timed(partial(embree, scene))
    for name in names:
        for threads in THREADS:
            os.environ["RAYFARM_BUILD_THREADS"] = str(threads)
            found[name, threads], trees[name] = timed(partial(build_uncached, scene.triangles, *BUILDS[name], costs))
    return found, trees


def peak(task: Callable[[], Any]) -> int:
    """The bytes of resident memory that `task` takes at most beyond what is held before it (Linux and glibc)."""
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")
    before = _status("VmRSS")
    task()
    return _status("VmHWM") - before


def _status(name: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(f"{name}:"))


def spread(values: list[float]) -> str:
    return f"{median(values):.2f} ({min(values):.2f}-{max(values):.2f})"


def row(name: str, runs: list[Round], scene: Scene, tree: Tree, costs: SahCosts) -> str:
    cpu = [run[name, 1][0] for run in runs]
    ratio = [run[name, 1][0] / run["embreex", 1][0] for run in runs]
    faster = [run[name, 1][1] / run[name, 2][1] for run in runs]
    wall = [median(run[name, threads][1] for run in runs) for threads in THREADS]
    overlap = f"{epo(tree, scene.triangles, costs):.2f}" if isinstance(tree, Bvh) else "0"
    held = len(tree.order) if isinstance(tree, Bvh) else len(tree.refs)
    grown = peak(partial(build_uncached, scene.triangles, *BUILDS[name], costs))
    return (
        f"| `{name}` | {spread(cpu)} | {spread(ratio)} | {wall[0]:.2f} | {wall[1]:.2f} | {spread(faster)} |"
        f" {tree.cost:.1f} | {overlap} | {held / len(scene.triangles):.2f} | {grown / len(scene.triangles):.0f} |"
    )


def report(name: str, builders: list[str], costs: SahCosts, rounds: int) -> None:
    scene = load(name)
    measured = [one_round(scene, builders, costs) for _ in range(rounds)]
    runs, trees = [found for found, _ in measured], measured[-1][1]
    base = [run["embreex", 1] for run in runs]
    print(
        f"\n{name}, {len(scene.triangles):,} triangles, costs ({costs.traversal:g}, {costs.intersection:g}), ", end=""
    )
    print(f"{rounds} rounds; embreex mesh and commit: {spread([cpu for cpu, _ in base])} CPU-s\n")
    print("| builder | CPU-s | of embreex | wall 1 | wall 2 | 1 over 2 | SAH | EPO | entries | peak bytes |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for builder in builders:
        print(row(builder, runs, scene, trees[builder], costs), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", default=SCENES)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--builders", default=",".join(BUILDS), help="a comma list of: " + ", ".join(BUILDS))
    parser.add_argument("--costs", choices=COSTS, default="plain", help="plain is (1, 1), paper is (3, 1.5)")
    options = parser.parse_args()
    builders = options.builders.split(",")
    if unknown := [name for name in builders if name not in BUILDS]:
        parser.error(f"there is no builder {unknown[0]!r}; choose from {', '.join(BUILDS)}")
    for name in builders:
        compile_builder(*BUILDS[name])
    for scene in options.scenes:
        report(scene, builders, COSTS[options.costs], max(1, options.rounds))


if __name__ == "__main__":
    main()
