"""ALU operations per fragment and per ray of a timed plan: a model, not a measurement.

Operations come from the SPIR-V of the very text that is timed, block by block; how often each block ran comes from
the counters of the instrumented run by conservation of flow (`renderer.alu.flow`). The paper's figure 11 shows what a
phone's counters said instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from renderer.alu.compiler import compile_spirv
from renderer.alu.errors import ModelError
from renderer.alu.facts import MAIN, Counted, Marks, counted, facts
from renderer.alu.flow import Flow, solve
from renderer.alu.marks import marked_text, read_marks
from renderer.alu.spirv import Block, Module, read_module
from renderer.alu.weights import KINDS, operations
from renderer.plan import Plan
from renderer.planner import in_passes
from renderer.prepare import Prepared
from renderer.records import Records

TOLERANCE = 0.01
"""The largest relative residual of the flow equations that gives a figure."""


@dataclass(frozen=True)
class AluModel:
    """ALU operations of the tracing program, or None with the reason in `text`.

    `per_fragment` is over all pixels, `per_ray` over the rays that are timed. `by_function` (callees apart) and
    `by_kind` divide `per_fragment`; `per_call` is what one call of a function takes, its callees included.
    `residual` is that of the flow equations.
    """

    per_fragment: float | None
    per_ray: float | None
    text: str
    by_function: Mapping[str, float] = field(default_factory=dict)
    by_kind: Mapping[str, float] = field(default_factory=dict)
    per_call: Mapping[str, float] = field(default_factory=dict)
    residual: float | None = None


def alu_model(plan: Plan, prepared: Prepared, records: Records) -> AluModel:
    """The model for a timed plan, from the records of the instrumented plan of the same request.

    Covers the tracing program of the frame passes: for hybrid not the rasteriser's. Never raises for a text it cannot
    judge: `text` then says why there is no figure.
    """
    try:
        if in_passes(prepared.scene, prepared.tree):
            raise ModelError("Brute force ran in passes, which carry no counters.")
        text, stage = tracing_text(plan)
        program = read_program(text, stage)
        return _figures(program, counted(prepared, records))
    except ModelError as error:
        return AluModel(None, None, f"No ALU model: {error}")


@dataclass(frozen=True, eq=False)
class AluProgram:
    """A program's blocks by function, the operations of one run of each block, and the blocks that count steps."""

    graph: Mapping[str, tuple[Block, ...]]
    costs: Mapping[str, list[dict[str, int]]]
    marks: Marks


def tracing_text(plan: Plan) -> tuple[str, str]:
    """The text and the stage of the program that traces rays in every frame."""
    found = plan.tracing()
    if len(found) != 1:
        raise ModelError(f"The plan traces its rays in {len(found)} programs a frame; the model covers one.")
    program, stage = found[0]
    return program.stages[stage], stage


@lru_cache(maxsize=64)
def read_program(text: str, stage: str) -> AluProgram:
    """Compile a timed text as it is, for its operations, and marked, for its steps; raise ModelError."""
    timed = read_module(compile_spirv(text, stage))
    marked = read_module(compile_spirv(marked_text(text), stage))
    if _shape(timed) != _shape(marked):
        raise ModelError("Marking the text changed its control flow.")
    costs = {name: [operations(timed, block) for block in blocks] for name, blocks in timed.functions.items()}
    return AluProgram(timed.functions, costs, read_marks(marked))


def _shape(module: Module) -> dict[str, list[tuple[tuple[int, ...], tuple[str, ...]]]]:
    return {name: [(block.successors, block.calls) for block in blocks] for name, blocks in module.functions.items()}


def _figures(program: AluProgram, counted: Counted) -> AluModel:
    flow = solve(program.graph, MAIN, facts(program.graph, program.marks, counted))
    if not flow.residual <= TOLERANCE:
        raise ModelError(
            f"The counted steps do not fit the program's flow: {flow.worst} misses by {flow.residual:.1%}, "
            f"and more than {TOLERANCE:.0%} gives no figure."
        )
    by_function, by_kind = _sums(program, flow, counted)
    per_fragment = sum(by_function.values())
    return AluModel(
        per_fragment=per_fragment,
        per_ray=per_fragment * counted.pixels / counted.rays if counted.rays else None,
        text=_sentence(counted, flow),
        by_function=by_function,
        by_kind=by_kind,
        per_call=per_call(program, flow),
        residual=flow.residual,
    )


def operations_of(program: AluProgram, flow: Flow, counted: Counted) -> float:
    """Operations of the program over pixels, by a flow that may know more than the counters."""
    return sum(_sums(program, flow, counted)[0].values())


def _sums(program: AluProgram, flow: Flow, counted: Counted) -> tuple[dict[str, float], dict[str, float]]:
    """Operations over pixels by function, callees apart, and by kind."""
    scale = counted.runs / counted.pixels
    by_function: dict[str, float] = {}
    by_kind = dict.fromkeys(KINDS, 0.0)
    for name, costs in program.costs.items():
        table = np.array([[cost[kind] for kind in KINDS] for cost in costs], np.float64)
        sums = scale * (flow.blocks[name] @ table)
        by_function[_plain(name)] = by_function.get(_plain(name), 0.0) + float(sums.sum())
        for kind, value in zip(KINDS, sums.tolist(), strict=True):
            by_kind[kind] += value
    return {name: value for name, value in by_function.items() if value}, by_kind


def per_call(program: AluProgram, flow: Flow) -> dict[str, float]:
    """Operations of one call of each function that ran, callees included, by plain name; of overloads the last."""
    whole: dict[str, float] = {}

    def take(name: str) -> float:
        # SPIR-V for shaders has no recursion.
        if name not in whole:
            inside = [
                sum(cost.values()) + sum(map(take, block.calls))
                for block, cost in zip(program.graph[name], program.costs[name], strict=True)
            ]
            entered = flow.entries[name]
            whole[name] = float(flow.blocks[name] @ np.array(inside)) / entered if entered else 0.0
        return whole[name]

    return {_plain(name): take(name) for name in program.graph if flow.entries[name]}


def _plain(name: str) -> str:
    return name.partition("(")[0]


def _sentence(counted: Counted, flow: Flow) -> str:
    return (
        "A model, not a measurement: scalar ALU operations of the tracing program's unoptimised SPIR-V (a vector "
        "operation counts once for each component, a division 2, square roots and other special functions 1 besides "
        "their products; memory, branches and calls 0), each basic block times how often it ran by the counters of "
        f"{counted.rays} rays over {counted.pixels} pixels (flow equations met within {flow.residual:.1g}), "
        "every ray alone, without the lanes that wait for others."
    )
