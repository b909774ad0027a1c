"""All traversals beside embreex and the paper's best: `python -m benchmarks.traversals [SCENE ...] [--write FILE]`.

Every variant is compiled once and then measured frame by frame in shuffled rounds, in which embreex traces the same
rays; ratios are taken within a round. On llvmpipe with one thread both are processor seconds, on a GPU frames are wall
seconds. Primary and shadow rays are measured apart. The paper's traversals walk floats and, where they can, 16-bit
boxes, all others the formats of `--nodes`; every BVH is built by each of `--builders`, and all is fetched as `--fetch`
says. Over plain trees `bvh-stack`, the paper's and those of KD-trees are fetched from storage buffers too. Prints
tables of each traversal's best variant in Markdown; `--write` puts them between the marks in a document.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median

from renderer.answering import silent
from renderer.build.tree import SahCosts
from renderer.instrumented import records_of
from renderer.judge.oracle import Oracle
from renderer.kept_twins import KeptTwins
from renderer.prepare import prepare
from renderer.recommend.pilot import Pilot
from renderer.records import Rays
from renderer.request import Request, parse_size
from renderer.variant import AXES, PAPER, TRAVERSALS, Variant, expand, matrix, refusal
from scenes.catalogue import list_scenes

SCENES = ("cornell-box", "crytek-sponza", "conference", "forest", "cornell-buddha", "happy-buddha")
BEGIN, END = "<!-- measured: traversals -->", "<!-- end of traversals -->"
HEAD = (
    "| variant | Mrays/s | to embreex | to bvh-stack | to the paper's best | MB | wrong | edge |\n"
    "|---|---|---|---|---|---|---|---|"
)
SUMMARY = (
    "| scene | rays | best of | variant | to embreex | to bvh-stack, fragment | compute "
    "| to the paper's best, fragment | compute | in 16-bit boxes too, fragment | compute "
    "| and however it is fetched, fragment | compute |"
    "\n|---|---|---|---|---|---|---|---|---|---|---|---|---|"
)
Times = dict[str, list[float]]


@dataclass(frozen=True)
class Measured:
    """One scene and kind of rays: `rays` of them a frame, each variant's buffers in bytes, and seconds of each round by
    variant and of embreex.
    """

    scene: str
    kind: str
    rays: int
    pilot: Pilot
    memory: dict[str, int]
    times: Times
    embree: list[float]


def variants(options: argparse.Namespace) -> list[Variant]:
    """What is measured: the paper's traversals in the formats that they could have taken, and all others."""
    found = []
    for name, row in TRAVERSALS.items():
        compared = row.paper or name == "bvh-stack"
        if row.structure == "none" or (name not in expand("traversal", options.traversals) and not compared):
            continue
        wanted = ("f32", "grid16") if compared else expand("nodes", options.nodes)
        nodes = [one for one in wanted if refusal(Variant(name, "compute", nodes=one)) is None] or ["f32"]
        axes = {"traversal": (name,), "method": expand("method", options.methods), "layout": (options.layout,)}
        axes["nodes"] = tuple(nodes)
        ways = {"builder": expand("builder", options.builders), "fetch": expand("fetch", options.fetch)}
        found += matrix({**axes, **ways}, options.rays[0])[0]
        if compared or row.structure == "kd":
            found += matrix({**axes, "builder": ("sah",), "fetch": PAPER["fetch"]}, options.rays[0])[0]
    return list(dict.fromkeys(found))


def measured(scene: str, kind: str, host: KeptTwins, options: argparse.Namespace) -> Measured:
    """Every round of every variant, in an order drawn anew for each."""
    requests = [
        Request(scene, one, options.size, frames=1, rounds=1, rays=kind, costs=options.sah) for one in variants(options)
    ]
    pilot = Pilot(requests, host)
    memory = {one.label: one.memory for one in pilot.candidates(silent)}
    labels = list(memory)
    against, rays = _embree(pilot, requests[0], kind)
    times: Times = {label: [] for label in labels}
    embree: list[float] = []
    chance = random.Random(options.seed)
    for number in range(options.rounds):
        print(f"{scene} {kind} {number + 1}/{options.rounds}", file=sys.stderr)
        embree.append(against())
        chance.shuffle(labels)
        for label, seconds in pilot.measure(labels, options.size, options.frames).items():
            if isinstance(seconds, str):
                print(f"{label}: {seconds}", file=sys.stderr)
                times.pop(label, None)
            elif label in times:
                times[label].append(seconds)
        labels = [label for label in labels if label in times]
    return Measured(scene, kind, rays, pilot, memory, times, embree)


def _embree(pilot: Pilot, request: Request, kind: str) -> tuple[Callable[[], float], int]:
    """What traces the frame's rays with embreex and tells its CPU seconds, and their number."""
    ready = prepare(request, pilot.scene)
    plan = ready.plan(instrument=True)
    records = records_of(ready, plan, pilot.host.collect(plan))
    rays: Rays = records.primary if kind == "primary" else records.shadow
    oracle = Oracle(pilot.scene.vertices, pilot.scene.faces)
    trace = oracle.trace_closest if kind == "primary" else oracle.trace_occluded

    def seconds() -> float:
        begun = time.process_time()
        trace(rays)
        return time.process_time() - begun

    return seconds, len(rays)


def ratios(base: Iterable[float], ours: Iterable[float]) -> list[float]:
    """How many times as fast as the base, round by round."""
    return [theirs / own for theirs, own in zip(base, ours, strict=True)]


def spread(values: list[float]) -> str:
    return f"{median(values):.2f} ({min(values):.2f}–{max(values):.2f})"


def fastest(found: Measured, wanted: Callable[[Variant], bool]) -> str:
    """The variant of least median time among those wanted."""
    labels = [label for label in found.times if wanted(found.pilot.requests[label].variant)]
    return min(labels, key=lambda label: median(found.times[label]))


def is_base(method: str) -> Callable[[Variant], bool]:
    """Whether a variant is the reference: `bvh-stack` over the plain tree in floats, in storage buffers."""
    return lambda variant: variant == Variant("bvh-stack", method, variant.layout)


def is_paper(method: str, nodes: Sequence[str], fetch: Sequence[str]) -> Callable[[Variant], bool]:
    """Whether a variant is one of the paper's over trees as the paper builds them, in these formats, fetched so."""

    def matches(one: Variant) -> bool:
        walks = TRAVERSALS[one.traversal].paper and one.nodes in nodes and one.fetch in fetch
        return walks and (one.method, one.builder) == (method, "sah")

    return matches


def best_of_each(found: Measured) -> list[str]:
    """The fastest variant of each traversal."""
    walks = {found.pilot.requests[label].variant.traversal for label in found.times}
    return [fastest(found, _walks(walk)) for walk in walks]


def _walks(traversal: str) -> Callable[[Variant], bool]:
    return lambda variant: variant.traversal == traversal


def _is_packet(variant: Variant) -> bool:
    return TRAVERSALS[variant.traversal].packet


def _is_single(variant: Variant) -> bool:
    return not _is_packet(variant)


def table(found: Measured, size: tuple[int, int], labels: Iterable[str]) -> str:
    """A row a variant, the fastest first; ratios to what has the same method."""
    lines = [f"`{found.scene}`, {found.kind} rays, {found.rays:,} a frame", "", HEAD]
    for label in sorted(labels, key=lambda one: median(found.times[one])):
        variant, times = found.pilot.requests[label].variant, found.times[label]
        judged = found.pilot.judge(label, size)
        errors = None if isinstance(judged, str) else found.pilot.facts[label].errors
        wrong = "–" if isinstance(judged, str) else f"{judged.wrong:.1e}"
        edge = "–" if errors is None or errors.edge is None else f"{errors.edge:.1e}"
        stack = found.times[fastest(found, is_base(variant.method))]
        paper = found.times[fastest(found, is_paper(variant.method, AXES["nodes"], PAPER["fetch"]))]
        beside = [spread(ratios(base, times)) for base in (found.embree, stack, paper)]
        cells = [label, f"{found.rays / median(times) / 1e6:.2f}", *beside, f"{found.memory[label] / 1e6:.2f}"]
        lines.append("| " + " | ".join([*cells, wrong, edge]) + " |")
    return "\n".join(lines)


def summary(found: Measured, methods: Iterable[str]) -> list[str]:
    """The best without packets, and the best of all; beside the reference and the paper's best of each method."""
    as_published = partial(is_paper, nodes=PAPER["nodes"], fetch=PAPER["fetch"])
    smaller = partial(is_paper, nodes=AXES["nodes"], fetch=PAPER["fetch"])
    fetched = partial(is_paper, nodes=AXES["nodes"], fetch=AXES["fetch"])
    bases = (is_base, as_published, smaller, fetched)
    rows = []
    for kind, which_of in (("single rays", _is_single), ("packets", _is_packet)):
        best = fastest(found, which_of)
        times = found.times[best]
        beside = [
            spread(ratios(found.times[fastest(found, which(method))], times)) if method in methods else "–"
            for which in bases
            for method in ("fragment", "compute")
        ]
        cells = [found.scene, found.kind, kind, best, spread(ratios(found.embree, times)), *beside]
        rows.append("| " + " | ".join(cells) + " |")
    return rows


def heading(found: Measured, options: argparse.Namespace) -> str:
    """What was measured, and by which clock."""
    clock = "processor" if found.pilot.clock == "cpu" else "wall"
    return (
        f"{found.pilot.device['name']}; {options.size[0]}x{options.size[1]}, {options.rounds} rounds, seed "
        f"{options.seed}, SAH costs ({options.sah.traversal:g}, {options.sah.intersection:g}), {clock} "
        "seconds: median (least–most)"
    )


def costs(text: str) -> SahCosts:
    """Read `CT,CI`."""
    traversal, intersection = text.split(",")
    return SahCosts(float(traversal), float(intersection))


def write(path: Path, text: str) -> None:
    """Put the tables between the document's marks."""
    before, mark, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not mark or not end:
        raise SystemExit(f"{path} has no lines {BEGIN} and {END}: add them where the tables are to stand.")
    path.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--size", type=parse_size, default=(512, 512))
    parser.add_argument("--rays", type=lambda text: text.split(","), default=["primary", "shadow"])
    parser.add_argument("--traversals", default="all", help="beside those that others are held against")
    parser.add_argument("--methods", default="fragment,compute")
    parser.add_argument("--nodes", default="grid16,quant8")
    parser.add_argument("--fetch", default="image")
    parser.add_argument("--layout", default="split", choices=AXES["layout"])
    parser.add_argument("--builders", default="sah,reinserted,sbvh-reinserted")
    parser.add_argument("--sah", type=costs, default=SahCosts(1.0, 1.0), metavar="CT,CI")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=1, help="a round, of which the fastest counts")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", action="store_true", help="print a row a variant, not only each traversal's best")
    parser.add_argument("--write", type=Path, metavar="FILE", help="a document with marks for the tables")
    options = parser.parse_args()
    here = {row["name"] for row in list_scenes() if row["here"]}
    tables, rows = [], []
    host = KeptTwins(1)  # one for all: it gives back what was not used for longest
    for scene in options.scenes or [name for name in SCENES if name in here]:
        for kind in options.rays:
            found = measured(scene, kind, host, options)
            tables.append(table(found, options.size, best_of_each(found)))
            print(table(found, options.size, found.times) if options.every else tables[-1], "\n", flush=True)
            rows += summary(found, options.methods.split(","))
            head = heading(found, options)
            del found
    overview = f"{head}\n\n" + "\n".join([SUMMARY, *rows])
    print(overview)
    if options.write is not None:
        write(options.write, "\n\n".join([overview, *tables]))


if __name__ == "__main__":
    main()
