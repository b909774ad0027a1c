"""The estimate of one plan on one GPU: static figures of its tracing program, and these by how often blocks run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import Any

from renderer.phone_compile.compiled import Answer, Compiled, compile_programs
from renderer.phone_compile.counted import Frame, tracing_program
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import Gpu
from renderer.phone_compile.listing import KINDS, MEMORY, Listing
from renderer.phone_compile.read import read_listing
from renderer.phone_compile.roofline import Roofline, roofline
from renderer.phone_compile.sites import Where, marked_text, sites_of
from renderer.phone_compile.toolchain import ToolChain
from renderer.phone_compile.weights import Weights, per_run, weigh
from renderer.plan import Plan, Program


@dataclass(frozen=True)
class Estimate:
    """One variant on one GPU; what is not known is None, with the sentence in `reason`.

    `alu_per_fragment` is as a vendor's profiler counts it: full operations plus half of those on half registers, moves
    among them; special functions apart. `memory_per_fragment` are all operations of MEMORY. `limit` names the limit of
    the GPU's driver that the plan does not keep, `kinds` the program's instructions, `per_fragment` their executions,
    `spills` the instructions that spill and fill (on Adreno, of private memory in all).
    """

    gpu: str
    label: str
    mesa: str
    stage: str | None = None
    instructions: int | None = None
    alu_per_fragment: float | None = None
    memory_per_fragment: float | None = None
    alu_per_ray: float | None = None
    memory_per_ray: float | None = None
    bytes_per_ray: float | None = None
    registers: int | None = None
    half_registers: int | None = None
    waves: int | None = None
    spills: int | None = None
    loops: int | None = None
    limit: str | None = None
    reason: str | None = None
    kinds: Mapping[str, int] = field(default_factory=dict)
    per_fragment: Mapping[str, float] = field(default_factory=dict)
    roofline: Roofline | None = None
    limits: Mapping[str, Any] = field(default_factory=dict)
    programs: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    residual: float | None = None
    freedom: int | None = None
    text: str = ""
    disassembly: tuple[str, ...] | None = None
    weights: tuple[tuple[int, int, float], ...] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON; the disassembly and the weights of its lines only where they were asked for."""
        values = asdict(self)
        for name in ("disassembly", "weights"):
            if values[name] is None:
                del values[name]
        return values


def estimate_all(
    chain: ToolChain, gpus: Sequence[Gpu], plan: Plan, frame: Frame | None, *, disassembly: bool = False
) -> list[Estimate]:
    """The estimates of a timed plan in the order of the GPUs, several at once; `frame` None leaves them static."""
    with ThreadPoolExecutor(min(len(gpus), os.cpu_count() or 1)) as pool:
        return list(pool.map(lambda gpu: estimate(chain, gpu, plan, frame, disassembly=disassembly), gpus))


def estimate(chain: ToolChain, gpu: Gpu, plan: Plan, frame: Frame | None, *, disassembly: bool = False) -> Estimate:
    """One GPU's estimate; never raises for a text that its driver does not take: `reason` then says why."""
    known: dict[str, Any] = {"gpu": gpu.name, "label": gpu.label, "mesa": chain.version}
    try:
        program, stage = tracing_program(plan)
        groups = _groups(program.stages[stage], frame)
        marked = [{**program.stages, stage: marked_text(program.stages[stage], group)} for group in groups]
        others = [other for other in plan.programs if other is not program]
        texts = [program.stages, *(other.stages for other in others), *marked]
        answer = compile_programs(chain, gpu, texts)
        known |= _limits(gpu, answer, plan)
        listing = read_listing(gpu, _program(answer, 0), stage)
        known |= _static(listing)
        known["programs"] = _others(gpu, others, answer.programs[1:])
        if disassembly:
            known["disassembly"] = listing.text
        if frame is None:
            return Estimate(**known, text=_text(gpu, chain, weighed=False))
        read = [_marked(gpu, answer, 1 + len(others) + i, stage) for i in range(len(groups))]
        weights = weigh(listing, list(zip(groups, read, strict=True)), frame.sites, frame.runs)
        known |= _weighed(gpu, listing, weights, frame)
        if disassembly:
            spans = zip(listing.blocks, weights.blocks.tolist(), strict=True)
            known["weights"] = tuple((*block.lines, executions) for block, executions in spans)
        return Estimate(**known, text=_text(gpu, chain, weighed=True))
    except CompileError as error:
        return Estimate(**known, reason=str(error), text=_text(gpu, chain, weighed=False))


def _groups(text: str, frame: Frame | None) -> list[list[Where]]:
    """What is marked in one text each: every site that ran, and all that did not together, whose sum is 0."""
    if frame is None:
        return []
    ran = [[where] for where in sites_of(text) if frame.sites[where]]
    idle = [where for where in sites_of(text) if not frame.sites[where]]
    return [*ran, *([idle] if idle else [])]


def _program(answer: Answer, index: int) -> Compiled:
    if index >= len(answer.programs):
        raise CompileError(answer.ended or "Mesa's driver gave no listing.")
    return answer.programs[index]


def _marked(gpu: Gpu, answer: Answer, index: int, stage: str) -> Listing | None:
    """A marked listing; None where the driver could not do it, which costs one count."""
    if index >= len(answer.programs) or answer.programs[index].complaint is not None:
        return None
    return read_listing(gpu, answer.programs[index], stage)


def _static(listing: Listing) -> dict[str, Any]:
    return {
        "stage": listing.stage,
        "instructions": listing.instructions,
        "registers": listing.registers,
        "half_registers": listing.half_registers,
        "waves": listing.waves,
        "spills": listing.spills,
        "loops": listing.loops,
        "kinds": {kind: count for kind, count in listing.kinds.items() if count},
    }


def _others(gpu: Gpu, programs: Sequence[Program], compiled: Sequence[Compiled]) -> dict[str, dict[str, int]]:
    """Instructions, registers and spills of the plan's programs that trace no rays."""
    found = {}
    for program, one in zip(programs, compiled, strict=False):
        stage = "compute" if "compute" in program.stages else "fragment"
        listing = read_listing(gpu, one, stage)
        counts = {"instructions": listing.instructions, "registers": listing.registers or 0, "spills": listing.spills}
        found[program.name] = counts
    return found


def _limits(gpu: Gpu, answer: Answer, plan: Plan) -> dict[str, Any]:
    """The plan's needs beside what Mesa's and the vendor's driver offer, and the first that is not kept."""
    drivers = {"vendor": ("the vendor's driver", gpu.vendor_limits), "mesa": ("Mesa's driver", answer.limits)}
    beside = {
        name: {"needs": needed, **{who: limits.get(name) for who, (_, limits) in drivers.items()}}
        for name, needed in plan.needs.items()
    }
    broken = (
        f"GL_MAX_{name} is {limits[name]} in {whose} for {gpu.name}, and the plan needs {needed}."
        for name, needed in plan.needs.items()
        for whose, limits in drivers.values()
        if needed > limits.get(name, needed)
    )
    return {"limits": beside, "limit": next(broken, None)}


def _weighed(gpu: Gpu, listing: Listing, weights: Weights, frame: Frame) -> dict[str, Any]:
    scale = frame.runs / frame.pixels
    units = sorted({unit for block in listing.blocks for unit in block.units})
    kinds = {kind: scale * value for kind, value in per_run(listing, weights, KINDS, "kinds").items()}
    work = {unit: scale * value for unit, value in per_run(listing, weights, units, "units").items()}
    alu = kinds["alu"] + kinds["move"] + kinds["half"] / 2
    memory = sum(kinds[kind] for kind in MEMORY)
    a_ray = frame.pixels / frame.rays if frame.rays else None
    bytes_per_ray = frame.bytes / frame.rays if frame.rays else None
    known: dict[str, Any] = {
        "alu_per_fragment": alu,
        "memory_per_fragment": memory,
        "per_fragment": {kind: value for kind, value in kinds.items() if value},
        "residual": weights.residual,
        "freedom": weights.freedom,
    }
    if a_ray is not None:
        of_ray = {name: value * a_ray for name, value in {**work, **kinds}.items()}
        known |= {
            "alu_per_ray": alu * a_ray,
            "memory_per_ray": memory * a_ray,
            "bytes_per_ray": bytes_per_ray,
            "roofline": roofline(gpu.family, of_ray, alu * a_ray, memory * a_ray, bytes_per_ray),
        }
    return known


def _text(gpu: Gpu, chain: ToolChain, *, weighed: bool) -> str:
    """What the figures are; the same for every result of a GPU, so that a comparison says it once."""
    start = f"{gpu.label}, not a measurement: Mesa {chain.version}'s compiler for {gpu.name}, which is not the vendor's"
    if not weighed:
        return f"{start}; instructions as they stand in the tracing program."
    half = ", those on half registers by half" if gpu.family == "ir3" else ""
    return (
        f"{start}; instructions of the tracing program, each basic block times how often it runs by llvmpipe's counts. "
        f"ALU counts moves{half} and no special functions; every ray alone, without the lanes that wait for others."
    )
