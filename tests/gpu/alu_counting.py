"""Counts on the GPU how often each braced branch and loop of a tracing program runs, and where that is in SPIR-V."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from running import ready

from renderer.alu.compiler import compile_spirv
from renderer.alu.flow import Site
from renderer.alu.model import tracing_text
from renderer.alu.spirv import STORE, Module, read_module
from renderer.plan import Buffer, Plan

_BRANCH = re.compile(r"^([ \t]+(?:\} else|while|for|if)\b[^\n]*\{)$", re.MULTILINE)
_HEAD = "precision highp int;\n"
COUNTING_BINDING = 7
COUNTING = """layout(std430, binding = 7) buffer Executed { uint executed[]; };
#define SITE(k) atomicAdd(executed[k], 1u)
"""
MARKING = """uint mark_site;
#define SITE(k) mark_site = uint(k)
"""


def sited(text: str, define: str) -> tuple[str, int]:
    """The text with SITE(k) behind every brace that opens a branch or a loop's body, and the number of these."""
    count = 0

    def number(match: re.Match[str]) -> str:
        nonlocal count
        count += 1
        return f"{match.group(1)} SITE({count - 1});"

    return _BRANCH.sub(number, text).replace(_HEAD, _HEAD + define, 1), count


def executed(plan: Plan) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    """How often each site of the plan's tracing program ran in one frame, (sites,) uint32."""
    text, _ = tracing_text(plan)
    counting, count = sited(text, COUNTING)
    counted = _with_text(plan, text, counting)
    steps = tuple(
        replace(step, storage={**step.storage, str(COUNTING_BINDING): "executed"}, collect="executed")
        if step.phase == "frame" and step.program.startswith("trace")
        else step
        for step in counted.passes
    )
    buffer = Buffer("executed", count * 4, np.zeros(count, np.uint32))
    with ready(replace(counted, passes=steps, buffers=(*plan.buffers, buffer))) as twin:
        ((_, words),) = twin.collect()
    return words[:count]


def sites(plan: Plan) -> dict[int, Site]:
    """The block of each site that the SPIR-V of the plan's tracing program holds."""
    text, stage = tracing_text(plan)
    return place_sites(read_module(compile_spirv(sited(text, MARKING)[0], stage)))


def place_sites(module: Module) -> dict[int, Site]:
    """The block of each site in a module whose text was under MARKING."""
    found = {}
    for name, blocks in module.functions.items():
        for index, block in enumerate(blocks):
            for instruction in block.instructions:
                if instruction.opcode == STORE and module.names.get(instruction.operands[0]) == "mark_site":
                    found[module.constants[instruction.operands[1]]] = (name, index)
    return found


def _with_text(plan: Plan, before: str, after: str) -> Plan:
    programs = tuple(
        replace(program, stages={stage: after if text == before else text for stage, text in program.stages.items()})
        for program in plan.programs
    )
    return replace(plan, programs=programs)
