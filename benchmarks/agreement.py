"""Agreement of the tree traversals with each other, bit for bit, and with embreex and the referee.

`python -m benchmarks.agreement [SCENE ...]`: every traversal, method and layout, 512x512 unless told otherwise.
"""

from __future__ import annotations

import argparse

from renderer.instrumented import records_of
from renderer.judge.accuracy import identical, judge
from renderer.judge.oracle import Oracle
from renderer.plan import PlanError
from renderer.prepare import prepare
from renderer.records import Records
from renderer.request import Request, parse_size
from renderer.twin_host import TwinHost
from renderer.variant import AXES, TRAVERSALS, Variant
from scenes.catalogue import list_scenes
from scenes.load import load

WALKS = tuple(name for name, row in TRAVERSALS.items() if row.structure != "none")


def report(name: str, size: tuple[int, int], methods: tuple[str, ...], layouts: tuple[str, ...]) -> None:
    """One line a variant."""
    scene = load(name)
    oracle, host = Oracle(scene.vertices, scene.faces), TwinHost(1)
    first: dict[bool, Records] = {}
    for traversal in WALKS:
        for method in methods:
            for layout in layouts:
                label = f"{name:20s} {traversal:18s} {method:9s} {layout:8s}"
                prepared = prepare(Request(name, Variant(traversal, method, layout), size))
                plan = prepared.plan(instrument=True)
                try:
                    records = records_of(prepared, plan, host.collect(plan))
                except PlanError as error:
                    print(f"{label} refused: {error}", flush=True)
                    continue
                base = first.setdefault(records.rasterised, records)
                difference = identical(base, records)
                errors = judge(scene.triangles, records, oracle, prepared.referee_tree(), "referee")
                same = "identical" if difference.same else f"DIFFERS {difference}"
                print(f"{label} {same} {errors.counts}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--methods", default=",".join(AXES["method"]))
    parser.add_argument("--layouts", default=",".join(AXES["layout"]))
    options = parser.parse_args()
    here = [row["name"] for row in list_scenes() if row["here"]]
    for name in options.scenes or here:
        report(name, options.size, tuple(options.methods.split(",")), tuple(options.layouts.split(",")))


if __name__ == "__main__":
    main()
