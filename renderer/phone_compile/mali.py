"""Reads a program of Mali's Bifrost or Valhall as Mesa's panfrost prints it after scheduling, and its statistics."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import Family
from renderer.phone_compile.listing import Block, Listing, require_totals

_STAGE = re.compile(r"^(?:SHADER-DB: )?MESA_SHADER_(\w+) shader: (.*)$")
_STATISTIC = re.compile(r"([\d.]+) ([a-z]+)(?=,|$)")
_SPILLS = re.compile(r"(\d+):(\d+) spills:fills")
_BEGIN = re.compile(r"^block(\d+) \{$")
_END = re.compile(r"^\}(?: -> ((?:block\d+ )+))?")
_NAME = re.compile(r"^(?:\S+(?:, \S+)* = )?([A-Z][A-Z0-9_]*)((?:\.\w+)*)")
_REGISTER = re.compile(r"\br(\d+)\b")
_STAGES = {"FRAGMENT": "fragment", "COMPUTE": "compute"}
"""Panfrost splits a vertex shader in two; what traces rays is one of these."""

ARITHMETIC_RATE, MESSAGE_RATE = 24.0, 1.0
"""Bifrost's arithmetic tuples and memory messages of one of the driver's cycles (Mesa, bifrost_compile.c)."""
VALHALL_RATES = {"fma": 64.0, "cvt": 64.0, "sfu": 16.0, "t": 4.0, "ls": 1.0}
"""Valhall's instructions of each unit in one of the driver's cycles (Mesa, bifrost_compile.c, for Mali G78)."""

_SPECIAL = frozenset(
    [
        "FRCP",
        "FRSQ",
        "FRCP_APPROX",
        "FRSQ_APPROX",
        "FEXP",
        "FLOGD",
        "FLOG_TABLE",
        "FEXP_TABLE",
        "FSIN_TABLE",
        "FCOS_TABLE",
        "FSINCOS_OFFSET",
        "FATAN_ASSIST",
        "FPCLASS",
    ]
)
_FLOW = frozenset(["BRANCHZ", "BRANCHZI", "BRANCH", "JUMP", "BRANCHC", "BRANCH_DIVERG", "BARRIER", "DISCARD"])
_OTHER = frozenset(["ATEST", "BLEND", "ZS_EMIT", "LD_TILE", "ST_TILE"])
_TEXTURE = ("TEX", "VAR_TEX", "LD_VAR")
_MEMORY = ("LOAD", "STORE", "LD_", "ST_", "LEA_", "ATOM")

# Valhall's units (Mesa, src/panfrost/compiler/valhall/ISA.xml) of what is neither memory nor texture nor unit CVT's.
_FMA = frozenset(
    [
        "FADD",
        "FADD_IMM",
        "FADD_LSCALE",
        "FMA",
        "IDP",
        "LDEXP",
        "FMA_RSCALE",
        "FMA_RSCALE_LEFT",
        "FMA_RSCALE_N",
        "FMA_RSCALE_SCALE16",
    ]
)
_SFU = _SPECIAL | frozenset(
    [
        "BITREV",
        "CLPER",
        "CUBEFACE1",
        "CUBEFACE2_V9",
        "CUBE_SSEL",
        "CUBE_TSEL",
        "IMUL",
        "IMULD",
        "MUX",
        "NOT_OLD",
        "POPCOUNT",
        "LSHIFT_AND",
        "LSHIFT_OR",
        "LSHIFT_XOR",
        "RSHIFT_AND",
        "RSHIFT_OR",
        "RSHIFT_XOR",
        "ARSHIFT_AND",
        "ARSHIFT_OR",
        "ARSHIFT_XOR",
    ]
)
_WIDE = frozenset((".s64", ".u64", ".i64"))


Span = tuple[int, int, tuple[int, ...]]
"""A block's first line, the one after its last, and the blocks that follow it."""
_Parse = Callable[[Sequence[str], "Counter[str]", "Counter[str]"], None]


def read_mali(family: Family, printed: str) -> list[Listing]:
    """The listings of one program's fragment or compute shader; raise CompileError for any that is misread."""
    listings = []
    begun: list[str] = []
    for line in printed.splitlines():
        stage = _STAGE.match(line)
        if stage is None:
            begun.append(line)
            continue
        if stage.group(1) in _STAGES:
            listings.append(_read(family, _STAGES[stage.group(1)], begun, stage.group(2)))
        begun = []
    return listings


def _read(family: Family, stage: str, printed: list[str], told: str) -> Listing:
    statistics = {name: float(value) for value, name in _STATISTIC.findall(told)}
    spills = _SPILLS.search(told)
    text, spans = _last_print(printed)
    parse = _bifrost_block if family == "bifrost" else _valhall_block
    blocks = tuple(_blocks(text, spans, parse))
    wanted = {"inst": 1.0, "tuples": 1.0, "clauses": 1.0, "arith": ARITHMETIC_RATE, "ldst": MESSAGE_RATE}
    require_totals(
        f"the {stage} shader", blocks, statistics, wanted if family == "bifrost" else {"inst": 1.0, **VALHALL_RATES}
    )
    registers = {number for line in text for number in _REGISTER.findall(line)}
    return Listing(
        stage=stage,
        text=tuple(text),
        blocks=blocks,
        statistics=statistics,
        registers=len(registers),
        waves=int(statistics["threads"]),
        spills=sum(int(count) for count in spills.groups()) if spills else 0,
        loops=int(statistics["loops"]),
    )


def _last_print(printed: list[str]) -> tuple[list[str], list[Span]]:
    """The lines of the last print before the binary's, and of each block where it begins and ends, and its successors.

    The driver prints a shader after each of several steps; the last is what it packs.
    """
    starts = [i for i, line in enumerate(printed) if line == "block0 {"]
    if not starts:
        raise CompileError("Mesa's driver printed no blocks of a shader: this version is not understood.")
    lines = printed[starts[-1] :]
    spans: list[Span] = []
    begun: int | None = None
    for i, line in enumerate(lines):
        if _BEGIN.match(line):
            begun = i + 1
        elif begun is not None and (end := _END.match(line)):
            following = tuple(int(word.removeprefix("block")) for word in (end.group(1) or "").split())
            spans.append((begun, i, following))
            begun = None
    return lines[: spans[-1][1] + 1], spans


def _blocks(text: list[str], spans: Sequence[Span], parse: _Parse) -> Iterator[Block]:
    for first, last, following in spans:
        kinds, units = Counter[str](), Counter[str]()
        parse(text[first:last], kinds, units)
        yield Block(following, dict(kinds), dict(units), (first, last))


def _bifrost_block(lines: Sequence[str], kinds: Counter[str], units: Counter[str]) -> None:
    """Clauses of tuples: `*` is what a tuple multiplies with, `+` what it adds with, which may send a message."""
    multiplies = False
    for line in lines:
        if line.startswith("id("):
            units["clauses"] += 1
            continue
        slot, text = line[:3].strip(), line[3:].strip()
        if slot not in ("*", "+"):
            continue
        name = _name(text)
        does = name != "NOP"
        if does:
            units["inst"] += 1
            kinds[_kind(name, text)] += 1
        elif slot == "+" and not multiplies:
            kinds["nop"] += 1
        if slot == "*":
            units["tuples"] += 1
            multiplies = does
        elif _is_message(name):
            units["arith"] += multiplies
            units["ldst"] += _is_memory(name)
        else:
            units["arith"] += 1


def _valhall_block(lines: Sequence[str], kinds: Counter[str], units: Counter[str]) -> None:
    for line in lines:
        name = _name(line.strip())
        units["inst"] += 1
        kinds[_kind(name, line)] += 1
        if name == "BLEND":
            # Packing puts the return address and the jump to the blend shader after it, which no print shows.
            units.update({"inst": 2, "cvt": 2})
            kinds.update({"alu": 1, "flow": 1})
        unit = _unit(name)
        if unit in ("fma", "cvt", "sfu"):
            match = _NAME.match(line.strip())
            wide = match is not None and any(part in match.group(2) for part in _WIDE)
            units[unit] += 2 if wide else 1
        elif unit is not None:
            units[unit] += 1


def _unit(name: str) -> str | None:
    if name in _OTHER or name == "BARRIER" or name.startswith("LD_VAR"):
        return None
    if name.startswith("TEX"):
        return "t"
    if _is_memory(name):
        return "ls"
    return "fma" if name in _FMA else "sfu" if name in _SFU else "cvt"


def _name(text: str) -> str:
    found = _NAME.match(text)
    if found is None:
        raise CompileError(f"A line of Mesa's listing is not understood: {text[:80]!r}.")
    return found.group(1)


def _is_message(name: str) -> bool:
    return _is_memory(name) or name in _OTHER or name.startswith(_TEXTURE) or name == "BARRIER"


def _is_memory(name: str) -> bool:
    return name.startswith(_MEMORY) and not name.startswith(_TEXTURE) and name not in _OTHER


def _kind(name: str, text: str) -> str:
    if name == "NOP":
        return "nop"
    if name in _FLOW:
        return "flow"
    if name in _OTHER:
        return "other"
    if name.startswith("ATOM"):
        # Bifrost prepares an atomic operation in the slot that multiplies, and sends it in the other.
        return "alu" if name.startswith("ATOM_C") and name != "ATOM_CX" else "atomic"
    if name.startswith(_TEXTURE):
        return "texture"
    if _is_memory(name):
        return "private" if ".tl" in text else "shared" if ".wls" in text else "memory"
    return "special" if name in _SPECIAL else "move" if name == "MOV" else "alu"
