"""What a run's records and the plan say of the tracing program's flow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from renderer.alu.errors import ModelError
from renderer.alu.flow import ENTRY, Fact, Graph, Site, back_edges
from renderer.alu.marks import Mark
from renderer.plan import GROUP
from renderer.prepare import Prepared
from renderer.records import COUNTERS, Records

MAIN, PIXEL, TRACE = "main", "render_pixel(vi2;", "trace(b1;"
SURFACE, BUDGET = "surface_from_hit(", "budget_spent("
LEAVES = ("intersect_slots(u1;u1;", "intersect_refs(u1;u1;")
"""Functions of `shaders/` whose executions are known, by the compiler's names; LEAVES test one leaf's triangles."""

BUDGET_TURNS = 2
"""The turns of the loop that watches the budget, as the planner's uniform sets them."""

Marks = Mapping[str, Mapping[Site, Mark]]


@dataclass(frozen=True)
class Counted:
    """What one frame took, in all: runs of main, pixels, rays that are timed, and COUNTERS over these.

    `hits` are pixels that see a surface, `lights` the turns of the loop over lights, 0 where nothing is shaded.
    `surface_words` says that `words` holds what was fetched to shade the surface, once for each of `hits`.
    """

    runs: int
    pixels: int
    rays: int
    hits: int
    lights: int
    steps: Mapping[str, float]
    surface_words: bool


def counted(prepared: Prepared, records: Records) -> Counted:
    """Sum the records over the rays that the request times."""
    request = prepared.request
    primary = request.rays != "shadow" and not records.rasterised
    chosen = [records.primary_counts] if primary else []
    if request.rays != "primary":
        chosen.append(records.shadow_counts)
    sums = np.concatenate(chosen).sum(axis=0, dtype=np.float64)
    width, height = records.size
    # Work groups overhang the image.
    runs = (
        -(-width // GROUP) * -(-height // GROUP) * GROUP**2 if request.variant.method == "compute" else width * height
    )
    return Counted(
        runs=runs,
        pixels=width * height,
        rays=sum(len(counts) for counts in chosen),
        hits=int((records.hits.primitive != -1).sum()),
        lights=0 if request.rays == "primary" else len(prepared.scene.lights),
        steps=dict(zip(COUNTERS, sums.tolist(), strict=True)),
        surface_words=primary,
    )


def facts(graph: Graph, marks: Marks, counted: Counted) -> list[Fact]:
    """The facts for `renderer.alu.flow.solve`, in executions for each run of main; raise ModelError where the program
    lacks a function that every tracing program has."""
    for name in (MAIN, PIXEL, TRACE, BUDGET):
        if name not in graph:
            raise ModelError(f"The tracing program has no function {name.partition('(')[0]}.")
    totals = [*_entries(graph, counted), *_loops(graph, counted), *_steps(graph, marks, counted)]
    return [Fact(fact.name, fact.sites, fact.value / counted.runs, fact.sense) for fact in totals]


def _entries(graph: Graph, counted: Counted) -> Iterator[Fact]:
    yield Fact("pixels", {(PIXEL, ENTRY): 1.0}, counted.pixels)
    yield Fact("rays", {(TRACE, ENTRY): 1.0}, counted.rays)
    yield Fact("ends of budget", {(BUDGET, ENTRY): 1.0}, counted.pixels)
    leaves = {(name, ENTRY): 1.0 for name in LEAVES if name in graph}
    if leaves:
        yield Fact("leaves tested", leaves, counted.steps["leaves"], "least")


def _loops(graph: Graph, counted: Counted) -> Iterator[Fact]:
    """The loops of a known length."""
    for name, turns in ((BUDGET, BUDGET_TURNS), (PIXEL, counted.lights)):
        tails = {tail for tail, _ in back_edges(graph[name])}
        if len(tails) != (turns > 0):
            raise ModelError(f"The function {name.partition('(')[0]} has {len(tails)} loops, which is not expected.")
        if tails:
            yield Fact(f"turns in {name.partition('(')[0]}", {(name, tails.pop()): 1.0}, counted.pixels * turns)


def _steps(graph: Graph, marks: Marks, counted: Counted) -> Iterator[Fact]:
    """The counters: those of trace itself, and the surface's words apart."""
    tracing = reached(graph, TRACE)
    surface = {site: mark.least for site, mark in marks["words"].items() if site[0] == SURFACE}
    for counter, value in counted.steps.items():
        sites = {site: mark for site, mark in marks[counter].items() if site[0] in tracing}
        if counter == "words" and counted.surface_words:
            value -= counted.hits * sum(surface.values())
        yield from _between(counter, sites, value)
    if SURFACE in reached(graph, MAIN) and surface:
        yield Fact("surfaces", surface, counted.hits * sum(surface.values()))


def _between(counter: str, sites: Mapping[Site, Mark], value: float) -> Iterator[Fact]:
    """An equation where every site counts a constant, else two bounds."""
    least = {site: mark.least for site, mark in sites.items() if mark.least}
    most = {site: mark.most for site, mark in sites.items() if mark.most}
    if least == most:
        yield Fact(counter, most, value)
        return
    yield Fact(counter, most, value, "least")
    if least:
        yield Fact(counter, least, value, "most")


def reached(graph: Graph, root: str) -> set[str]:
    """The routine and all that it calls, directly or not."""
    found, waiting = {root}, [root]
    while waiting:
        for node in graph[waiting.pop()]:
            fresh = set(node.calls) - found
            found |= fresh
            waiting += fresh
    return found
