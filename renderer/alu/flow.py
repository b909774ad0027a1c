"""How often every basic block ran, from a few counts and the conservation of flow. Knows nothing of SPIR-V.

What flows into a block flows out of it, a routine is entered as often as its call sites run, and each fact is one more
linear equation (or bound) over block executions. Where these leave freedom, a loop turns no more often than they
require, and then a branch goes each of its ways alike: the solution is the one of least squares of loop turns, then of
differences between the ways of a branch, among all that fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from renderer.alu.least import least_squares

Array = npt.NDArray[np.float64]

ENTRY = -1
"""The `block` of a site that stands for entering the routine from outside."""

Site = tuple[str, int]
"""A routine and one of its blocks, or ENTRY."""


class Node(Protocol):
    """A basic block: where it goes on within its routine (nowhere: it returns), and which routines it calls."""

    @property
    def successors(self) -> tuple[int, ...]:
        """Indices into the routine's blocks."""

    @property
    def calls(self) -> tuple[str, ...]:
        """Names of routines; a routine called twice is named twice."""


Graph = Mapping[str, Sequence[Node]]
"""Routines by name; block 0 is where each begins."""


@dataclass(frozen=True)
class Fact:
    """The sum over `sites` of executions times weight is `value`, or at least or at most that; in executions for each
    one of the root."""

    name: str
    sites: Mapping[Site, float]
    value: float
    sense: Literal["equal", "least", "most"] = "equal"


@dataclass(frozen=True, eq=False)
class Flow:
    """Executions of every block by routine, and of each routine's entry.

    `residual` is the largest miss of any equation, relative to its value or to 1 where that is less; `worst` names it.
    """

    blocks: dict[str, Array]
    entries: dict[str, float]
    residual: float
    worst: str


def solve(graph: Graph, root: str, facts: Sequence[Fact]) -> Flow:
    """The executions of all blocks when `root` is entered once on average."""
    system = _System(graph, root, facts)
    flows = least_squares(system.equations, system.values, system.wishes())
    misses = np.abs(system.equations @ flows - system.values) / np.maximum(np.abs(system.values), 1.0)
    worst = int(misses.argmax())
    blocks = {name: np.array(rows) @ flows for name, rows in system.inflow.items()}
    entries = {name: float(flows @ row) for name, row in system.entry.items()}
    return Flow(blocks, entries, float(misses[worst]), system.names[worst])


def back_edges(nodes: Sequence[Node]) -> set[tuple[int, int]]:
    """Edges that close a loop: those met again on the way down of a depth-first walk from block 0."""
    found: set[tuple[int, int]] = set()
    open_blocks, done = {0}, set()
    path: list[tuple[int, Iterator[int]]] = [(0, iter(nodes[0].successors))]
    while path:
        block, rest = path[-1]
        after = next(rest, None)
        if after is None:
            path.pop()
            open_blocks.discard(block)
            done.add(block)
        elif after in open_blocks:
            found.add((block, after))
        elif after not in done:
            open_blocks.add(after)
            path.append((after, iter(nodes[after].successors)))
    return found


def loop_bodies(nodes: Sequence[Node]) -> list[set[int]]:
    """The blocks of each natural loop: those that reach its back edge without passing its head."""
    before: dict[int, list[int]] = {}
    for block, node in enumerate(nodes):
        for after in node.successors:
            before.setdefault(after, []).append(block)
    bodies = []
    for tail, head in sorted(back_edges(nodes)):
        body, waiting = {head}, [tail]
        while waiting:
            block = waiting.pop()
            if block not in body:
                body.add(block)
                waiting += before.get(block, [])
        bodies.append(body)
    return bodies


class _System:
    """The unknowns are the ways of branches, the root's entry, and the slack of each bound, all at least zero; what
    flows elsewhere is a sum of these."""

    def __init__(self, graph: Graph, root: str, facts: Sequence[Fact]) -> None:
        self._graph = graph
        self._ways: dict[tuple[str, int], list[int]] = {}
        slacked = [fact for fact in facts if fact.sense != "equal"]
        self._width = 1 + len(slacked)
        for name, nodes in graph.items():
            for block, node in enumerate(nodes):
                if len(node.successors) > 1:
                    self._ways[name, block] = list(range(self._width, self._width + len(node.successors)))
                    self._width += len(node.successors)
        self.entry, self.inflow = self._flows(root)
        self.names: list[str] = []
        self._rows: list[Array] = []
        self._values: list[float] = []
        self._add(f"the entry of {root}", self._unit(0), 1.0)
        for (name, block), ways in self._ways.items():
            self._add(f"block {block} of {name}", self.inflow[name][block] - self._unit(*ways), 0.0)
        for slack, fact in enumerate(slacked, 1):
            self._state(fact, self._unit(slack) * (-1.0 if fact.sense == "least" else 1.0))
        for fact in facts:
            if fact.sense == "equal":
                self._state(fact, np.zeros(self._width))
        self.equations, self.values = np.array(self._rows), np.array(self._values)

    def wishes(self) -> tuple[Array, Array]:
        """What is to be least where there is freedom, in this order: loop turns, differences between ways."""
        turns: list[Array] = []
        differences: list[Array] = []
        for name, nodes in self._graph.items():
            turns += [self.inflow[name][tail] for tail in sorted({tail for tail, _ in back_edges(nodes)})]
            bodies = loop_bodies(nodes)
            for block, node in enumerate(nodes):
                ways = self._ways.get((name, block), [])
                if not any(block in body and not body.issuperset(node.successors) for body in bodies):
                    differences += [self._unit(one) - self._unit(other) for one, other in pairwise(ways)]
        return _stack(turns, self._width), _stack(differences, self._width)

    def _flows(self, root: str) -> tuple[dict[str, Array], dict[str, list[Array]]]:
        """Sums of the unknowns for the entry of each routine and for each block, callers before callees."""
        entry = {name: np.zeros(self._width) for name in self._graph}
        entry[root] = self._unit(0)
        inflow = {}
        for name in _callers_first(self._graph):
            inflow[name] = self._inflow(name, entry[name])
            for node, row in zip(self._graph[name], inflow[name], strict=True):
                for callee in node.calls:
                    entry[callee] = entry[callee] + row
        return entry, inflow

    def _inflow(self, name: str, entry: Array) -> list[Array]:
        nodes = self._graph[name]
        rows = [np.zeros(self._width) for _ in nodes]
        starts = [(0, entry)]
        for block, node in enumerate(nodes):
            ways = self._ways.get((name, block), [])
            starts += [(after, self._unit(way)) for way, after in zip(ways, node.successors, strict=False)]
        for start, flow in starts:
            # Down to the next branch or return, unchanged; a ring without a branch would not end.
            block, left = start, len(nodes)
            while left:
                rows[block] += flow
                left = left - 1 if len(nodes[block].successors) == 1 else 0
                block = nodes[block].successors[0] if left else block
        return rows

    def _unit(self, *at: int) -> Array:
        row = np.zeros(self._width)
        row[list(at)] = 1.0
        return row

    def _state(self, fact: Fact, row: Array) -> None:
        for (name, block), weight in fact.sites.items():
            row = row + weight * (self.entry[name] if block == ENTRY else self.inflow[name][block])
        self._add(fact.name, row, fact.value)

    def _add(self, name: str, row: Array, value: float) -> None:
        # Rows of like size, so that a fact in words weighs no more than one in steps.
        scale = max(float(np.abs(row).max()), 1.0)
        self.names.append(name)
        self._rows.append(row / scale)
        self._values.append(value / scale)


def _callers_first(graph: Graph) -> list[str]:
    """The routines in an order in which each comes before those it calls; raise ValueError for recursion."""
    order: list[str] = []
    state: dict[str, bool] = {}

    def visit(name: str) -> None:
        if name in state:
            if not state[name]:
                raise ValueError(f"{name} calls itself: recursion has no linear flow.")
            return
        state[name] = False
        for node in graph[name]:
            for callee in node.calls:
                visit(callee)
        state[name] = True
        order.append(name)

    for name in graph:
        visit(name)
    return order[::-1]


def _stack(rows: Sequence[Array], width: int) -> Array:
    return np.array(rows).reshape(len(rows), width)
