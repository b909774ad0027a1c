"""How often each block of a driver's listing runs: sites counted on llvmpipe, then conservation of flow."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from renderer.alu.flow import Fact, solve
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.listing import Listing
from renderer.phone_compile.places import Place, find_places
from renderer.phone_compile.sites import Where

ROOT = "main"
TOLERANCE, MOST_FREEDOM = 0.01, 4
"""The largest relative residual of the flow equations, and the most ways left open, that give a figure."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Executions of every block for one run of the program; `residual` is that of the flow equations, `freedom` how
    many of the flow's ways the counts leave open, `lost` the sites that ran and that the listing does not show."""

    blocks: npt.NDArray[np.float64]
    residual: float
    freedom: int
    lost: int


Marked = Sequence[tuple[Collection[Where], Listing | None]]
"""Listings of one program with some of its sites marked; None for one that could not be had."""


def weigh(listing: Listing, marked: Marked, executions: Mapping[Where, int], runs: int) -> Weights:
    """Executions of a listing's blocks over `runs` of the program, from counts of its sites.

    Raise CompileError where the counts do not fit the listing's flow.
    """
    nodes = [_Node(block.successors) for block in listing.blocks]
    facts, lost = [], 0
    for wheres, other in marked:
        count = sum(executions[where] for where in wheres)
        places = None if other is None else find_places(listing, other)
        if not places:
            lost += count > 0
            continue
        sites = {(ROOT, _node(nodes, place)): float(times) for place, times in places.items()}
        facts.append(Fact(f"site {min(wheres).index}", sites, count / runs))
    flow = solve({ROOT: nodes}, ROOT, facts)
    if not flow.residual <= TOLERANCE:
        raise CompileError(
            f"The counts of llvmpipe do not fit the flow of the listing: {flow.worst} misses by {flow.residual:.1%}, "
            f"and more than {TOLERANCE:.0%} gives no figure."
        )
    freedom = _freedom(nodes, facts)
    if freedom > MOST_FREEDOM:
        raise CompileError(
            f"Only {len(facts)} of the text's {len(facts) + lost} branches and loops that ran are found: "
            f"{freedom} of its ways are left open, and that gives no figure."
        )
    return Weights(flow.blocks[ROOT][: len(listing.blocks)], flow.residual, freedom, lost)


def _freedom(nodes: Sequence[_Node], facts: Sequence[Fact]) -> int:
    """Edges less the independent equations about them: 0 where the counts alone give every block its executions."""
    edges = [(i, after) for i, node in enumerate(nodes) for after in node.successors]
    into = np.zeros((len(nodes), len(edges)))
    out = np.zeros_like(into)
    for k, (before, after) in enumerate(edges):
        into[after, k] += 1.0
        out[before, k] += 1.0
    inner = [i for i, node in enumerate(nodes) if node.successors]
    counted = [sum(weight * into[block] for (_, block), weight in fact.sites.items()) for fact in facts]
    rows = np.vstack([into[inner] - out[inner], *([counted] if counted else [])])
    return len(edges) - int(np.linalg.matrix_rank(rows))


@dataclass(frozen=True)
class _Node:
    """A block's ways on, or a block that stands for an edge."""

    successors: tuple[int, ...]
    calls: tuple[str, ...] = ()


def _node(nodes: list[_Node], place: Place) -> int:
    """The node of a place; an edge becomes one when it is first asked for."""
    if isinstance(place, int):
        return place
    following = nodes[place.before].successors
    if place.after not in following:
        # Another site stands on the same edge already.
        return next(i for i in following if nodes[i].successors == (place.after,))
    new = len(nodes)
    nodes.append(_Node((place.after,)))
    nodes[place.before] = _Node(tuple(new if after == place.after else after for after in following))
    return new


def per_run(
    listing: Listing, weights: Weights, names: Sequence[str], of: Literal["kinds", "units"]
) -> dict[str, float]:
    """Instructions of each kind, or driver's unit, for one run of the program."""
    counts = [block.kinds if of == "kinds" else block.units for block in listing.blocks]
    table = np.array([[count.get(name, 0) for name in names] for count in counts], np.float64)
    return dict(zip(names, (weights.blocks @ table).tolist(), strict=True))
