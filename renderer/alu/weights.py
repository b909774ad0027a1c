"""What counts as an ALU operation, and how many one SPIR-V instruction stands for.

One operation is one scalar arithmetic, comparison, selection, conversion or bit operation; a vector instruction is as
many as it has components. Square roots, reciprocals, exponentials and the trigonometric functions are one each, as
one instruction starts them; a quotient is a reciprocal and a product. Memory, addresses within aggregates, phi,
shuffles, reinterpreted bits, branches and calls are no ALU work; addresses that the shader itself computes are.
"""

from __future__ import annotations

from renderer.alu.errors import ModelError
from renderer.alu.spirv import EXT_INST, Block, Instruction, Module

KINDS = ("arithmetic", "special", "compare", "select", "logic", "bits", "convert")
"""The kinds that operations are told apart by; `special` are GLSL.std.450's functions that are more than min, max and
their like."""

# Opcodes to (kind, operations for each component of the result).
_EACH: dict[int, tuple[str, int]] = {
    **dict.fromkeys(range(126, 134), ("arithmetic", 1)),  # negate, add, subtract, multiply
    136: ("arithmetic", 2),  # FDiv: a reciprocal and a product
    **dict.fromkeys((140, 141), ("arithmetic", 4)),  # FRem, FMod: quotient, floor, product, difference less one fused
    **dict.fromkeys((142, 143), ("arithmetic", 1)),  # vector or matrix times scalar
    147: ("arithmetic", 1),  # outer product
    **dict.fromkeys(range(109, 116), ("convert", 1)),
    **dict.fromkeys((156, 157, *range(170, 192)), ("compare", 1)),
    169: ("select", 1),
    **dict.fromkeys(range(164, 169), ("logic", 1)),
    **dict.fromkeys(range(194, 206), ("bits", 1)),
}

# Functions and calls, variables, loads and stores, access chains, lengths of arrays, composites, images, bitcasts, phi
# and control flow.
_FREE = frozenset(
    (0, 1, 8, 54, 55, 56, 57, 59, 61, 62, 65, 68, *range(77, 85), *range(86, 108), 124, *range(245, 256), 317)
)

_EXT_EACH: dict[int, tuple[str, int]] = {
    **dict.fromkeys((*range(1, 11), *range(37, 43), 48, 79, 80), ("arithmetic", 1)),  # round to fract, min, max, step
    **dict.fromkeys((11, 12), ("arithmetic", 1)),  # radians, degrees
    **dict.fromkeys((43, 44, 45, 81), ("arithmetic", 2)),  # clamp
    46: ("arithmetic", 3),  # mix, as it is written: two products, of which one by 1 - a
    50: ("arithmetic", 2),  # fma
    **dict.fromkeys((13, 14, *range(27, 33)), ("special", 1)),  # sin, cos, exp, log, sqrt, inversesqrt
    15: ("special", 3),  # tan
    26: ("special", 3),  # pow: log2, product, exp2
    49: ("special", 9),  # smoothstep
    **dict.fromkeys((73, 74, 75), ("bits", 1)),  # find lsb, msb
}

# Whole instructions of GLSL.std.450: clamp, scale, round, convert and pack for each of two halves, and so on.
_EXT_WHOLE: dict[int, tuple[str, int]] = {
    **dict.fromkeys((56, 57), ("special", 11)),  # pack 2x16: 2 x (clamp 2, scale, round, convert), shift, or
    **dict.fromkeys((60, 61), ("special", 10)),  # unpack 2x16: 2 x (extract, convert, scale, clamp 2)
    58: ("special", 3),  # pack half 2x16: 2 conversions, a pack
    62: ("special", 2),
    68: ("arithmetic", 9),  # cross: 6 products, 3 differences
}


def operations(module: Module, block: Block) -> dict[str, int]:
    """The ALU operations of one run through a block by kind, callees not among them.

    Raises ModelError for an instruction that has no weight.
    """
    sums = dict.fromkeys(KINDS, 0)
    for instruction in block.instructions:
        kind, count = _extended(module, instruction) if instruction.opcode == EXT_INST else _core(module, instruction)
        sums[kind] += count
    return sums


def _core(module: Module, instruction: Instruction) -> tuple[str, int]:
    opcode, operands = instruction.opcode, instruction.operands
    if opcode in _EACH:
        kind, weight = _EACH[opcode]
        return kind, weight * module.components(operands[0])
    if opcode in _FREE:
        return "arithmetic", 0
    inner = module.components_of(operands[2]) if len(operands) > 2 and operands[2] in module.types else 0
    match opcode:
        case 148:
            return "arithmetic", 2 * inner - 1
        case 144 | 145 | 146:
            return "arithmetic", _product(module, instruction)
        case 151 | 152:
            return "arithmetic", 2 * inner  # a whole product: its low and its high word
        case 154 | 155:
            return "logic", inner - 1
    raise ModelError(f"The ALU model has no weight for SPIR-V's instruction {opcode}.")


def _product(module: Module, instruction: Instruction) -> int:
    """A product with a matrix: a dot product for every component of the result."""
    left = module.types[instruction.operands[2]]
    shared = module.rows[left] if instruction.opcode == 144 else module.columns[left]
    return module.components(instruction.operands[0]) * (2 * shared - 1)


def _extended(module: Module, instruction: Instruction) -> tuple[str, int]:
    result, _, _, function, *arguments = instruction.operands
    n = module.components(result)
    if function in _EXT_EACH:
        kind, weight = _EXT_EACH[function]
        return kind, weight * n
    if function in _EXT_WHOLE:
        return _EXT_WHOLE[function]
    match function:
        case 66:
            return "special", 2 * module.components_of(arguments[0])  # dot product, square root
        case 67:
            return "special", 3 * module.components_of(arguments[0])
        case 69:
            return "special", 3 * n  # dot product, inverse square root, n products
        case 70:
            return "special", 3 * n  # dot product, comparison, n selections
        case 71:
            return "special", 4 * n  # dot product, doubled, n products and differences
    raise ModelError(f"The ALU model has no weight for GLSL.std.450's instruction {function}.")
