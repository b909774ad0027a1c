"""Reads a listing of Adreno's instruction set as Mesa's ir3 prints it, and the statistics beside it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.listing import Block, Listing, require_totals

_PREFIX = "MESA: info: "
_START = re.compile(r"Native code for \S+ (\w+) shader\b")
_FLAGS = re.compile(r"\s*\((\w+?)(\d*)\)\s*")
_LABEL = re.compile(r"^l(\d+):$")
_TARGET = re.compile(r"#l(\d+)$")
_STATISTIC = re.compile(r"(-?\d+) ([^,]+?)(?=,|\s*$)")
_REGISTER = re.compile(r"\b(h?)[rc]\d+\.[xyzw]")
_STAGES = {"VERT": "vertex", "FRAG": "fragment", "CL": "compute"}

# Opcodes by category (Mesa, src/freedreno/isa/ir3-cat*.xml): a name up to its first dot. All others are category 2.
_CATEGORIES: dict[int, frozenset[str]] = {
    0: frozenset(
        [
            "nop",
            "br",
            "brao",
            "braa",
            "brac",
            "bany",
            "ball",
            "brax",
            "jump",
            "call",
            "ret",
            "kill",
            "demote",
            "end",
            "emit",
            "cut",
            "chmask",
            "chsh",
            "flow_rev",
            "bkt",
            "stks",
            "stkr",
            "xset",
            "xclr",
            "getone",
            "getlast",
            "shps",
            "shpe",
            "predt",
            "predf",
            "prede",
        ]
    ),
    1: frozenset(["mov", "cov", "mova", "mova1", "swz", "gat", "sct", "movmsk", "movs"]),
    3: frozenset(
        ["raw", "mad", "madsh", "sel", "sad", "shlm", "shlg", "shrm", "shrg", "andg", "dp2acc", "dp4acc", "wmm"]
    ),
    4: frozenset(["rcp", "rsq", "sqrt", "log2", "exp2", "sin", "cos", "hrsq", "hlog2", "hexp2"]),
    5: frozenset(
        [
            "isam",
            "isaml",
            "isamm",
            "sam",
            "samb",
            "saml",
            "samgq",
            "samgp0",
            "samgp1",
            "samgp2",
            "samgp3",
            "getlod",
            "conv",
            "convm",
            "getsize",
            "getbuf",
            "getpos",
            "getinfo",
            "dsx",
            "dsy",
            "gather4r",
            "gather4g",
            "gather4b",
            "gather4a",
            "dsxpp",
            "dsypp",
            "rgetpos",
            "rgetinfo",
            "tcinv",
            "brcst",
            "quad_shuffle",
        ]
    ),
    6: frozenset(
        [
            "ldg",
            "ldga",
            "ldl",
            "ldp",
            "ldgb",
            "ldlw",
            "ldlv",
            "ldib",
            "ldc",
            "stg",
            "stga",
            "stl",
            "stp",
            "stgb",
            "stlw",
            "stib",
            "stc",
            "resinfo",
            "resbase",
            "atomic",
            "prefetch",
            "getspid",
            "getwid",
            "getfiberid",
            "g2l",
            "l2g",
        ]
    ),
    7: frozenset(["bar", "fence", "sleep", "icinv", "dccln", "dcinv", "dcflu", "ccinv", "lock", "unlock", "alias"]),
}
_CATEGORY = {name: category for category, names in _CATEGORIES.items() for name in names}
_BRANCHES = frozenset(["br", "brao", "braa", "brac", "bany", "ball", "brax", "getone", "getlast"])
_PREDICATES = ("predt", "predf", "prede")
_PRIVATE, _SHARED = frozenset(("ldp", "stp")), frozenset(("ldl", "stl", "ldlw", "stlw"))
_UNITS = ("inst", "nops", *(f"cat{category}" for category in range(8)))


@dataclass(frozen=True)
class _Instruction:
    line: int
    name: str
    operands: str
    repeat: int
    nops: int

    @property
    def target(self) -> int | None:
        """The label that it may go to."""
        found = _TARGET.search(self.operands)
        return None if found is None else int(found.group(1))


def read_ir3(printed: str, messages: Sequence[str]) -> list[Listing]:
    """The listings of one program, one for each stage but the binning ones; raise CompileError for any that is
    misread."""
    lines = [line.removeprefix(_PREFIX) for line in printed.splitlines() if line.startswith(_PREFIX.rstrip())]
    told = {}
    for message in messages:
        name, mark, rest = message.partition(" shader: ")
        if mark and name in _STAGES:
            told[name] = {key.strip(): float(value) for value, key in _STATISTIC.findall(rest)}
    starts = [(i, found.group(1)) for i, line in enumerate(lines) if (found := _START.match(line))]
    listings = {}
    for at, name in starts:
        if name in _STAGES:
            if name not in told:
                raise CompileError(f"Mesa's driver printed a {_STAGES[name]} shader and no statistics of it.")
            listings[name] = _read(_STAGES[name], _body(lines, at + 1), told[name])
    return list(listings.values())


def _body(lines: Sequence[str], start: int) -> list[str]:
    """The lines of one listing: instructions and labels, up to what follows `end`."""
    body = []
    for line in lines[start:]:
        if line.startswith("; ") and ": outputs:" in line:
            break
        if line and not line.startswith((";", "@", "SIMD")):
            body.append(line)
    return body


def _read(stage: str, body: list[str], statistics: dict[str, float]) -> Listing:
    last = next((i for i, line in enumerate(body) if _plain(line).split(" ")[0] == "end"), len(body) - 1)
    # What follows `end` is padding.
    body = body[: last + 1]
    blocks = tuple(_blocks(_parts(body)))
    require_totals(f"the {stage} shader", blocks, statistics, dict.fromkeys(_UNITS, 1.0))
    return Listing(
        stage=stage,
        text=tuple(body),
        blocks=blocks,
        statistics=statistics,
        registers=int(statistics["full"]),
        half_registers=int(statistics["half"]),
        waves=int(statistics["waves"]),
        spills=int(statistics["stp"]) + int(statistics["ldp"]),
        loops=int(statistics["loops"]),
    )


@dataclass
class _Part:
    """Instructions that follow one another, and the label before them."""

    label: int | None
    instructions: list[_Instruction] = field(default_factory=list)


def _parts(body: Sequence[str]) -> list[_Part]:
    parts = [_Part(None)]
    preamble = False
    for number, line in enumerate(body):
        label = _LABEL.match(line)
        if label is not None:
            parts.append(_Part(int(label.group(1))))
            continue
        instruction = _instruction(number, line)
        # What `shps` and `shpe` enclose runs once for a whole draw, and the driver counts it apart.
        preamble = preamble or instruction.name == "shps"
        if preamble:
            preamble = instruction.name != "shpe"
            continue
        if instruction.name in _PREDICATES and parts[-1].instructions:
            parts.append(_Part(None))
        parts[-1].instructions.append(instruction)
        if instruction.name in _BRANCHES or instruction.name in ("jump", "end", *_PREDICATES[:2]):
            parts.append(_Part(None))
    return _without_empty(parts)


def _without_empty(parts: list[_Part]) -> list[_Part]:
    """Labels that share their place become one block: an empty part goes, unless it is a label's only one."""
    kept: list[_Part] = []
    for part in parts:
        if part.instructions or part.label is not None:
            kept.append(part)
    return kept


def _blocks(parts: Sequence[_Part]) -> Iterator[Block]:
    labels: dict[int | None, int] = {part.label: i for i, part in enumerate(parts) if part.label is not None}
    for i, part in enumerate(parts):
        kinds, units = Counter[str](), Counter[str]()
        for instruction in part.instructions:
            _count(instruction, kinds, units)
        numbers = [instruction.line for instruction in part.instructions]
        span = (numbers[0], numbers[-1] + 1) if numbers else (0, 0)
        yield Block(_successors(parts, i, labels), dict(kinds), dict(units), span)


def _successors(parts: Sequence[_Part], at: int, labels: dict[int | None, int]) -> tuple[int, ...]:
    following = (at + 1,) if at + 1 < len(parts) else ()
    last = parts[at].instructions[-1] if parts[at].instructions else None
    if last is None:
        return following
    if last.name == "end":
        return ()
    if last.name == "jump":
        return (_place(labels, last),)
    if last.name in _BRANCHES:
        return (_place(labels, last), *following)
    if last.name in _PREDICATES[:2]:
        # What follows runs where the predicate holds, up to the next of them.
        other = next(
            (
                j
                for j in range(at + 1, len(parts))
                if parts[j].instructions and parts[j].instructions[0].name in _PREDICATES
            ),
            None,
        )
        return (*following, *(() if other is None or other == at + 1 else (other,)))
    return following


def _place(labels: dict[int | None, int], branch: _Instruction) -> int:
    target = branch.target
    if target is None or target not in labels:
        raise CompileError(f"A branch of the listing goes nowhere: {branch.name} {branch.operands}.")
    return labels[target]


def _instruction(line: int, text: str) -> _Instruction:
    repeat = nops = at = 0
    while found := _FLAGS.match(text, at):
        if found.group(1) == "rpt":
            repeat = int(found.group(2))
        elif found.group(1) == "nop":
            nops = int(found.group(2))
        at = found.end()
    name, _, operands = text[at:].strip().partition(" ")
    if not repeat and not nops:
        # Without a repeat, a source's repeat bit is a bit of the number of empty slots (`bary.f` is printed so).
        sources = operands.split(", ")[1:3]
        nops = sum(1 << i for i, source in enumerate(sources) if source.startswith("(r)"))
    return _Instruction(line, name, operands.strip(), repeat, nops)


def _plain(line: str) -> str:
    instruction = _instruction(0, line)
    return f"{instruction.name} {instruction.operands}"


def _count(instruction: _Instruction, kinds: Counter[str], units: Counter[str]) -> None:
    base = instruction.name.split(".")[0]
    times = 2 if base == "swz" else 1 + instruction.repeat  # A swap is encoded as two moves.
    category = _CATEGORY.get(base, 2)
    units["inst"] += times + instruction.nops
    units[f"cat{category}"] += times
    units["cat0"] += instruction.nops
    units["nops"] += instruction.nops + (times if base == "nop" else 0)
    kinds["nop"] += instruction.nops
    kinds[_kind(category, base, instruction.operands)] += times


def _is_half(operands: str) -> bool:
    """Whether an operation is done in 16 bits: its sources say so, as a result may be narrower than they are."""
    sources = _REGISTER.findall(operands.partition(",")[2])
    return bool(sources) and all(source == "h" for source in sources)


def _kind(category: int, base: str, operands: str) -> str:
    match category:
        case 0:
            return "nop" if base == "nop" else "flow"
        case 1:
            return "move"
        case 2 | 3:
            return "half" if _is_half(operands) else "alu"
        case 4:
            return "special"
        case 5:
            return "memory" if base.startswith("isam") else "texture"
        case 6 if base in _PRIVATE:
            return "private"
        case 6 if base in _SHARED:
            return "shared"
        case 6:
            return "atomic" if base == "atomic" else "memory"
    return "other"
