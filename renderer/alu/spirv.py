"""Reads a SPIR-V binary: its functions, their basic blocks, and what the types and constants are.

Khronos, SPIR-V specification, version 1.0, sections 2.3 (physical layout) and 3.32 (instructions).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from renderer.alu.errors import ModelError

MAGIC = 0x07230203
_HEADER_WORDS = 5

NAME, EXT_INST = 5, 12
TYPE_VECTOR, TYPE_MATRIX = 23, 24
CONSTANT_TRUE, CONSTANT_FALSE, CONSTANT = 41, 42, 43
FUNCTION, FUNCTION_CALL = 54, 57
STORE = 62
LABEL, BRANCH, BRANCH_CONDITIONAL, SWITCH = 248, 249, 250, 251
ENDINGS = frozenset((BRANCH, BRANCH_CONDITIONAL, SWITCH, 252, 253, 254, 255))


@dataclass(frozen=True)
class Instruction:
    """One instruction; `operands` are all words after the first, type and result ids among them."""

    opcode: int
    operands: tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """A basic block: `successors` index the function's blocks (none where it returns), `calls` name functions."""

    instructions: tuple[Instruction, ...]
    successors: tuple[int, ...]
    calls: tuple[str, ...]


@dataclass(frozen=True)
class Module:
    """Functions by name (`trace(b1;`), in the binary's order; block 0 is a function's entry.

    `names` are debug names by id; `constants` scalar values as unsigned words, booleans as 0 and 1; `rows` and
    `columns` the components of vector and matrix types by id; `types` the type of every value by id.
    """

    functions: dict[str, tuple[Block, ...]] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    constants: dict[int, int] = field(default_factory=dict)
    rows: dict[int, int] = field(default_factory=dict)
    columns: dict[int, int] = field(default_factory=dict)
    types: dict[int, int] = field(default_factory=dict)

    def components(self, type_id: int) -> int:
        """How many scalars a value of this type has."""
        return self.rows.get(type_id, 1) * self.columns.get(type_id, 1)

    def components_of(self, value: int) -> int:
        """How many scalars this value has."""
        return self.components(self.types[value])


def read_module(binary: bytes) -> Module:
    """Read a module; raise ModelError where the binary is none or is torn."""
    module = Module()
    body: list[Instruction] = []
    bodies: list[list[Instruction]] = []
    for instruction in _instructions(binary):
        if instruction.opcode == FUNCTION:
            body = []
            bodies.append(body)
        body.append(instruction)
        _note(module, instruction)
    for body in bodies:
        name = module.names.get(body[0].operands[1], f"%{body[0].operands[1]}")
        module.functions[name] = tuple(_blocks(module, body))
    return module


def _instructions(binary: bytes) -> Iterator[Instruction]:
    if len(binary) % 4 or len(binary) < 4 * _HEADER_WORDS:
        raise ModelError("This is no SPIR-V: its length is wrong.")
    words = np.frombuffer(binary, "<u4").tolist()
    if words[0] != MAGIC:
        raise ModelError("This is no SPIR-V: it does not begin with the magic number.")
    at = _HEADER_WORDS
    while at < len(words):
        length = words[at] >> 16
        if length == 0 or at + length > len(words):
            raise ModelError("This SPIR-V is torn: an instruction runs past the end.")
        yield Instruction(words[at] & 0xFFFF, tuple(words[at + 1 : at + length]))
        at += length


def _note(module: Module, instruction: Instruction) -> None:
    """Keep what blocks refer to by id."""
    opcode, operands = instruction.opcode, instruction.operands
    if opcode == NAME:
        module.names[operands[0]] = _text(operands[1:])
    elif opcode in (TYPE_VECTOR, TYPE_MATRIX):
        result, of, count = operands
        module.columns[result] = count if opcode == TYPE_MATRIX else 1
        module.rows[result] = module.rows[of] if opcode == TYPE_MATRIX else count
    elif opcode in (CONSTANT_TRUE, CONSTANT_FALSE):
        module.constants[operands[1]] = int(opcode == CONSTANT_TRUE)
    elif opcode == CONSTANT:
        module.constants[operands[1]] = operands[2]
    if _has_type(opcode):
        module.types[operands[1]] = operands[0]


def _has_type(opcode: int) -> bool:
    """Whether the operands begin with a type and a result, of the instructions that glslang makes of shaders."""
    return (
        opcode in (1, EXT_INST, 54, 55, 57, 59, 61, 65, 68, 245)
        or 41 <= opcode <= 52
        or 77 <= opcode <= 98
        or 100 <= opcode <= 215
        or 227 <= opcode <= 242
    ) and opcode not in (STORE,)


def _blocks(module: Module, body: list[Instruction]) -> Iterator[Block]:
    """Cut a function's instructions at its labels."""
    labels = [i for i, instruction in enumerate(body) if instruction.opcode == LABEL]
    index = {body[at].operands[0]: i for i, at in enumerate(labels)}
    for at, after in zip(labels, [*labels[1:], len(body) - 1], strict=True):
        inside = tuple(body[at + 1 : after])
        if not inside or inside[-1].opcode not in ENDINGS:
            raise ModelError("This SPIR-V is torn: a block does not end.")
        called = [i.operands[2] for i in inside if i.opcode == FUNCTION_CALL]
        yield Block(
            inside,
            tuple(index[label] for label in _targets(inside[-1])),
            tuple(module.names.get(target, f"%{target}") for target in called),
        )


def _targets(ending: Instruction) -> tuple[int, ...]:
    match ending.opcode:
        case 249:
            return ending.operands
        case 250:
            return ending.operands[1:3]
        case 251:
            return (ending.operands[1], *ending.operands[3::2])
    return ()


def _text(words: tuple[int, ...]) -> str:
    """A zero-ended string in words."""
    return np.array(words, "<u4").tobytes().split(b"\0")[0].decode()
