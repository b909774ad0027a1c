"""CPU seconds of the builders beside embreex's, interleaved in one run: `python -m benchmarks.builders [FILE ...]`.

Without a file every mesh in the folders of RAYFARM_SCENES is measured, the largest last. A build starts from the
triangles, as embreex's mesh object does: bounds, and padding for the KD-tree, are in it; compilation is not.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from renderer.build.api import bounds, compile_builder
from renderer.build.bvh import build_bvh
from renderer.build.kd import build_kd
from renderer.build.pad import padded
from renderer.build.tree import KD_LEAF, Bvh, Floats, SahCosts, Tree
from scenes.load import load
from scenes.places import folders
from scenes.scene import Scene

PAPER = SahCosts(3.0, 1.5)
PLAIN = SahCosts(1.0, 1.0)
Seconds = dict[str, float]


def embree_seconds(given: Scene) -> Seconds:
    """CPU seconds of embreex's mesh object, in its faster form, and of its commit, which the first ray sets off."""
    start = time.process_time()
    scene = EmbreeScene()
    mesh = TriangleMesh(scene, given.vertices, given.faces)
    made = time.process_time()
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    done = time.process_time()
    del mesh
    return {"embreex mesh": made - start, "embreex commit": done - made}


def make_bvh(triangles: Floats, costs: SahCosts) -> Tree:
    return build_bvh(bounds(triangles), costs)


def make_kd(triangles: Floats, costs: SahCosts) -> Tree:
    return build_kd(padded(bounds(triangles)), costs)


def seconds(task: Callable[[], Any]) -> float:
    start = time.process_time()
    task()
    return time.process_time() - start


def one_round(scene: Scene) -> Seconds:
    """Everything once, in turn, so that drift of the machine hits all alike."""
    triangles = scene.triangles
    found = embree_seconds(scene)
    found["bvh"] = seconds(partial(make_bvh, triangles, PAPER))
    found["kd"] = seconds(partial(make_kd, triangles, PAPER))
    return found


def spread(values: list[float]) -> str:
    return f"{min(values):8.3f} {median(values):8.3f} {max(values):8.3f}"


def describe(tree: Tree, costs: SahCosts) -> str:
    inner = int((tree.count == 0).sum()) if isinstance(tree, Bvh) else int((tree.axis != KD_LEAF).sum())
    kind = "bvh" if isinstance(tree, Bvh) else "kd"
    held = len(tree.order) if isinstance(tree, Bvh) else len(tree.refs)
    return (
        f"  {kind:<4} costs ({costs.traversal:g}, {costs.intersection:g}): SAH cost {tree.cost:.2f}, "
        f"depth {tree.depth}, nodes {len(tree.count)} ({inner} inner), triangle entries {held}"
    )


def report(path: Path, rounds: int) -> None:
    scene = load(str(path))
    triangles = scene.triangles
    print(f"\n{path.name}: {len(triangles)} triangles, {rounds} rounds, CPU seconds (min, median, max)")
    runs = [one_round(scene) for _ in range(rounds)]
    for name in runs[0]:
        print(f"  {name:<34}{spread([run[name] for run in runs])}")
    for name in ("bvh", "kd"):
        ratios = [run[name] / (run["embreex mesh"] + run["embreex commit"]) for run in runs]
        print(f"  {name + ' / embreex mesh + commit':<34}{spread(ratios)}")
    for costs in (PLAIN, PAPER):
        print(describe(make_bvh(triangles, costs), costs))
        print(describe(make_kd(triangles, costs), costs))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    files = options.files or sorted(
        (path for folder in folders() for path in folder.glob("*.ply")), key=lambda path: path.stat().st_size
    )
    if not files:
        parser.error("no mesh was found; name a file, or set RAYFARM_SCENES to folders that hold some")
    compile_builder("bvh")
    compile_builder("kd")
    for path in files:
        report(path, max(1, options.rounds))
    print(f"\npeak memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MiB")


if __name__ == "__main__":
    main()
