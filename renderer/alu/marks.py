"""Marks: the counting macros of a traversal's text made into stores that SPIR-V shows and that are no ALU work.

`shaders/common_ray.glsl` leaves COUNT_* empty where nothing is counted. In the marked text each stores its argument to
a global of its own, so that the basic block of every counted step is known.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from renderer.alu.errors import ModelError
from renderer.alu.flow import Site
from renderer.alu.spirv import STORE, Module

_PREFIX = "mark_"
_DECLARED = {"nodes": "uint", "inner": "bool", "leaves": "uint", "triangles": "uint", "words": "uint"}

# What each macro stores; {0} and {1} are its parameters.
_STORES = {
    "COUNT_NODE": "mark_nodes = 1u; mark_words = uint({0})",
    "COUNT_INNER": "mark_inner = true",
    "COUNT_LEAF": "mark_leaves = 1u",
    "COUNT_VISIT": "mark_inner = bool({0}); mark_leaves = uint({1})",
    "COUNT_TRIANGLE": "mark_triangles = 1u; mark_words = uint({0})",
    "COUNT_WORDS": "mark_words = uint({0})",
}
_EMPTY = re.compile(r"^#define (COUNT_\w+)(?:\(([^)]*)\))?[ \t]*$", re.MULTILINE)


@dataclass(frozen=True)
class Mark:
    """How many of a counter's steps a block counts in one run; `most` exceeds `least` where the count is data."""

    least: float
    most: float


def marked_text(text: str) -> str:
    """The text with its empty counting macros made into marks; one without them comes back as it is.

    Raises ModelError for a macro that has no mark.
    """
    found = list(_EMPTY.finditer(text))
    if not found:
        return text
    globals_ = "".join(f"{kind} {_PREFIX}{counter};\n" for counter, kind in _DECLARED.items())
    start = found[0].start()
    return text[:start] + globals_ + _EMPTY.sub(_define, text[start:])


def read_marks(module: Module) -> dict[str, dict[Site, Mark]]:
    """The blocks that count, by counter (`renderer.records.COUNTERS`)."""
    variables = {
        id_: name.removeprefix(_PREFIX)
        for id_, name in module.names.items()
        if name.startswith(_PREFIX) and name.removeprefix(_PREFIX) in _DECLARED
    }
    marks: dict[str, dict[Site, Mark]] = {counter: {} for counter in _DECLARED}
    for function, blocks in module.functions.items():
        for index, block in enumerate(blocks):
            for instruction in block.instructions:
                if instruction.opcode == STORE and instruction.operands[0] in variables:
                    counter = variables[instruction.operands[0]]
                    _add(marks[counter], (function, index), _mark(module, counter, instruction.operands[1]))
    return marks


def _define(match: re.Match[str]) -> str:
    name, parameters = match.group(1), match.group(2)
    if name not in _STORES:
        raise ModelError(f"The ALU model knows no mark for {name}.")
    names = [] if parameters is None else [part.strip() for part in parameters.split(",")]
    shown = name if parameters is None else f"{name}({parameters})"
    return f"#define {shown} {_STORES[name].format(*(f'({part})' for part in names))}"


def _mark(module: Module, counter: str, value: int) -> Mark:
    if value not in module.constants:
        if counter == "words":
            raise ModelError("A counted number of words is not a constant.")
        return Mark(0.0, 1.0)
    stored = float(module.constants[value])
    if counter != "words":
        stored = min(stored, 1.0)
    return Mark(stored, stored)


def _add(sites: dict[Site, Mark], site: Site, mark: Mark) -> None:
    before = sites.get(site, Mark(0.0, 0.0))
    sites[site] = Mark(before.least + mark.least, before.most + mark.most)
