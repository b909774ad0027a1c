"""Sites: where a text's control flow parts. Each is counted on llvmpipe and found again in a driver's listing.

A site stands behind every brace that opens a branch or a loop's body, once for what happens within a shadow ray's walk
and once for all else, since compilers give the two walks blocks of their own.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.host import Host
from renderer.plan import Buffer, Plan, Program

BINDING = 7
"""A storage binding that no plan uses."""

_BRANCH = re.compile(r"^([ \t]*(?:\} else|while|for|if|do)\b[^\n]*\{)[ \t]*$", re.MULTILINE)
_HEAD = re.compile(r"\A(?:#(?:version|extension)[^\n]*\n|precision[^\n]*\n)+")
_CALL = re.compile(r"\btrace\((true|false)\);")
_TRACE = re.compile(r"^void trace\([^\n]*\{$.*?^\}$", re.MULTILINE | re.DOTALL)
_MAIN = re.compile(r"\bvoid main\(\)")
_RAY = "bool site_shadow = false;\n"


@dataclass(frozen=True, order=True)
class Where:
    """The `index`-th branch or loop of a text, within a shadow ray's walk or not."""

    index: int
    shadow: bool


def sites_of(text: str) -> list[Where]:
    """All sites of a text; some may lie in parts that are left out of it."""
    count, shared = len(_BRANCH.findall(text)), _shared(text)
    return [Where(k, shadow) for k in range(count) for shadow in ((False, True) if k < shared else (False,))]


def counting_text(text: str) -> str:
    """The text with every site counted: `executed[2 k]` at site k, `executed[2 k + 1]` in shadow rays' walks."""
    count, shared = len(_BRANCH.findall(text)), _shared(text)
    counters = "".join(f"uvec2 site_{k} = uvec2(0u);\n" for k in range(count))
    buffer = f"layout(std430, binding = {BINDING}) buffer Executed {{ uint executed[]; }};\n"

    def count_at(k: int) -> str:
        by = "uvec2(site_shadow ? 0u : 1u, site_shadow ? 1u : 0u)" if k < shared else "uvec2(1u, 0u)"
        return f"site_{k} += {by};"

    ends = "".join(
        f"    atomicAdd(executed[{2 * k + part}], site_{k}.{'xy'[part]});\n" for k in range(count) for part in (0, 1)
    )
    main = f"\nvoid main() {{\n    sited_main();\n{ends}}}\n"
    sited = _headed(_with_sites(text, count_at), buffer + _RAY + counters)
    return _MAIN.sub("void sited_main()", sited) + main


def marked_text(text: str, wheres: Collection[Where]) -> str:
    """The text with an atomic operation at each of some sites, which no compiler may drop, move or merge."""
    buffer = f"layout(std430, binding = {BINDING}) buffer Marked {{ uint marked[]; }};\n"
    shared = _shared(text)

    def mark_at(k: int) -> str:
        marks = [f"atomicAdd(marked[{k}], 1u);" for where in wheres if where.index == k]
        held = [f"if ({'' if where.shadow else '!'}site_shadow) {{ " for where in wheres if where.index == k]
        return " ".join(f"{test}{mark} }}" if k < shared else mark for test, mark in zip(held, marks, strict=True))

    return _headed(_with_sites(text, mark_at), buffer + _RAY)


def executions(plan: Plan, program: Program, stage: str, host: Host) -> dict[Where, int]:
    """How often each site of a program of the plan ran in one frame; the device's lock must be held."""
    text = program.stages[stage]
    wanted = sites_of(text)
    count = 2 * (1 + max((where.index for where in wanted), default=0))
    sited = replace(program, stages={**program.stages, stage: counting_text(text)})
    steps = tuple(
        replace(step, storage={**step.storage, str(BINDING): "executed"}, collect="executed")
        if step.phase == "frame" and step.program == program.name
        else step
        for step in plan.passes
    )
    counting = replace(
        plan,
        passes=steps,
        programs=tuple(sited if each is program else each for each in plan.programs),
        buffers=(*plan.buffers, Buffer("executed", count * 4, np.zeros(count, np.uint32))),
    )
    sums = _sums([words[:count] for _, words in host.collect(counting)])
    return {where: int(sums[2 * where.index + where.shadow]) for where in wanted}


def _sums(collected: list[npt.NDArray[np.uint32]]) -> npt.NDArray[np.int64]:
    """What was counted in all, from the counters after each tile: they go on, and round about 2^32."""
    before = np.zeros_like(collected[0])
    total = np.zeros(len(before), np.int64)
    for words in collected:
        total += (words - before).astype(np.int64)
        before = words
    return total


def _shared(text: str) -> int:
    """How many sites lie before the end of `trace`, so that a primary and a shadow ray's walk may share them."""
    trace = _TRACE.search(text)
    both = {call.group(1) for call in _CALL.finditer(text)} == {"true", "false"}
    return len(_BRANCH.findall(text[: trace.end()])) if trace is not None and both else 0


def _with_sites(text: str, at: Callable[[int], str]) -> str:
    places = itertools.count()
    sited = _BRANCH.sub(lambda match: f"{match.group(1)} {at(next(places))}", text)
    # Set before each walk, so that a compiler that puts the walk in place knows it there.
    return _CALL.sub(r"site_shadow = \1; trace(\1);", sited)


def _headed(text: str, declared: str) -> str:
    head = _HEAD.match(text)
    end = head.end() if head else 0
    return text[:end] + declared + text[end:]
