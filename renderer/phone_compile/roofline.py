"""A static roofline: what a ray's ALU work, memory operations and bytes would take, and which of them the most.

Cycles are those in which one lane's memory operation is done. Only Mali's rates are published, by Mesa from Arm's own
tool; Adreno's ratio is an assumption, and so is a vec4 of bytes for each memory operation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from renderer.phone_compile.gpus import Family
from renderer.phone_compile.mali import ARITHMETIC_RATE, VALHALL_RATES

BYTES_RATE = 16.0


@dataclass(frozen=True)
class Rates:
    """Operations in the time of one memory operation: by the driver's units or by kinds, and who says so."""

    alu: Mapping[str, float]
    source: str


RATES: dict[Family, Rates] = {
    "ir3": Rates(
        {"alu": 16.0, "move": 16.0, "half": 32.0, "special": 4.0},
        "16 ALU operations, 32 on half registers or 4 special ones for each memory operation: an assumption",
    ),
    "bifrost": Rates(
        {"arith": ARITHMETIC_RATE}, "24 arithmetic tuples for each memory operation, as Mesa's statistics take it"
    ),
    "valhall": Rates(
        {unit: VALHALL_RATES[unit] for unit in ("fma", "cvt", "sfu")},
        "64 FMA, 64 CVT and 16 SFU instructions for each memory operation, as Mesa's statistics take it",
    ),
}


@dataclass(frozen=True)
class Roofline:
    """Cycles of a ray by what takes them; `bound` is the greatest. `balance` is ALU operations for each memory
    operation: a GPU that does more of them in its time is bound by memory. `bytes` is None where they are not counted.
    """

    alu_cycles: float
    memory_cycles: float
    bytes_cycles: float | None
    bound: str
    balance: float | None
    source: str


def roofline(
    family: Family, work: Mapping[str, float], alu: float, memory: float, bytes_read: float | None
) -> Roofline:
    """The roofline of a ray: its `work` by the driver's units and kinds, ALU and memory operations, bytes."""
    rates = RATES[family]
    taken = [work.get(name, 0.0) / rate for name, rate in rates.alu.items()]
    # Valhall's units work side by side; Adreno's operations wait for one another.
    alu_cycles = max(taken) if family == "valhall" else sum(taken)
    cycles = {"ALU": alu_cycles, "memory operations": memory}
    if bytes_read is not None:
        cycles["bytes"] = bytes_read / BYTES_RATE
    bound = max(cycles, key=cycles.__getitem__)
    return Roofline(
        alu_cycles, memory, cycles.get("bytes"), bound, alu / memory if memory else None, f"Rates: {rates.source}."
    )
