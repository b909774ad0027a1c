"""What a driver's listing comes to, whatever its instruction set: basic blocks, kinds of instructions, statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from renderer.phone_compile.errors import CompileError

KINDS = (
    "alu", "half", "move", "special", "memory", "private", "shared", "texture", "atomic", "flow", "nop", "other",
)  # fmt: skip
"""What instructions are told apart by. `half` is ALU work on half registers, `special` reciprocals, roots and the like,
`private` a thread's own memory (spills, and arrays that found no registers), `shared` a work group's, `nop` empty
slots."""

MEMORY = ("memory", "private", "shared", "texture", "atomic")
"""The kinds that go to memory."""


@dataclass(frozen=True)
class Block:
    """A basic block: its instructions by KINDS and by the driver's own units, and which lines show it.

    `successors` index the listing's blocks; `calls` is empty, as drivers inline everything.
    """

    successors: tuple[int, ...]
    kinds: Mapping[str, int]
    units: Mapping[str, int]
    lines: tuple[int, int]
    calls: tuple[str, ...] = ()


@dataclass(frozen=True)
class Listing:
    """One shader's listing. `statistics` are the driver's own, by its names; `registers`, `waves` (None where they
    are not told), `spills` and `loops` are read from them."""

    stage: str
    text: tuple[str, ...]
    blocks: tuple[Block, ...]
    statistics: Mapping[str, float]
    registers: int | None
    waves: int | None
    spills: int
    loops: int
    half_registers: int = 0

    @property
    def instructions(self) -> int:
        """How many instructions the driver counts."""
        return int(self.statistics["inst"])

    @property
    def kinds(self) -> dict[str, int]:
        """Instructions by KINDS."""
        return {kind: sum(block.kinds.get(kind, 0) for block in self.blocks) for kind in KINDS}

    @property
    def shape(self) -> tuple[tuple[int, ...], ...]:
        """The control flow."""
        return tuple(block.successors for block in self.blocks)


def require_totals(
    name: str, blocks: Sequence[Block], statistics: Mapping[str, float], wanted: Mapping[str, float]
) -> None:
    """Raise CompileError unless the blocks' units come to what the driver counted; `wanted` maps the driver's names to
    how many units it counts as one."""
    for unit, share in wanted.items():
        counted = sum(block.units.get(unit, 0) for block in blocks)
        told = statistics.get(unit)
        if told is None:
            raise CompileError(
                f"Mesa's driver does not say how many {unit} {name} has: this version is not understood."
            )
        if abs(counted - told * share) > 1e-3 * max(1.0, share):
            raise CompileError(
                f"The listing of {name} is misread: {counted} {unit}, where Mesa's driver counted {told * share:g}."
            )
