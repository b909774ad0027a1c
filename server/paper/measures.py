"""Counts, models and imported figures: what a section has of each, by one source for all of its cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from server.paper.data import Cell, Json, Section, number
from server.paper.verdict import Basis

Read = Callable[[Json], float | None]


@dataclass(frozen=True)
class Measure:
    """A figure of a document: its name, its unit and where it is from."""

    name: str
    unit: str
    basis: Basis
    read: Read


def lines_bytes(document: Json) -> float | None:
    """Bytes that a ray's fetches move under the cache model: its lines times their size."""
    lines, size = number(document, "per_ray", "lines"), number(document, "model", "lines", "line_bytes")
    return None if lines is None else lines * (size or 64.0)


def nodes_a_pixel(document: Json) -> float | None:
    """Nodes fetched a pixel, by primary and shadow rays together (paper, section 4.1)."""
    nodes, pixels = number(document, "per_ray", "nodes"), 1.0
    rays = [number(document, "rays", kind) for kind in ("primary", "shadow")]
    for side in document.get("size") or ():
        pixels *= float(side)
    if nodes is None or None in rays or not pixels:
        return None
    return nodes * sum(count for count in rays if count is not None) / pixels


def error_of(document: Json) -> float | None:
    """False hits, false misses and wrong primitives together, a fraction of primary rays; None unless all are known.

    Hybrid casts no primary rays: its own figure is the pixels that rasterising sees otherwise than rays.
    """
    if document.get("method") == "hybrid":
        return number(document, "error", "raster_mismatch")
    parts = [number(document, "error", name) for name in ("false_hit", "false_miss", "wrong_primitive")]
    known = [part for part in parts if part is not None]
    return sum(known) if len(known) == len(parts) else None


def _reader(*path: str) -> Read:
    return lambda document: number(document, *path)


SP_READ = Measure("SP Memory Read", "bytes a draw", "imported", _reader("profile", "sp_memory_read"))
SP_READ_RATE = Measure("SP Memory Read", "bytes a second", "imported", _reader("profile", "sp_memory_read_per_s"))
LINES = Measure("Memory fetched in whole lines", "bytes a ray", "model", lines_bytes)
REQUESTED = Measure("Memory requested", "bytes a ray", "counted", _reader("per_ray", "bytes"))
ALU_IMPORTED = Measure("ALU / Fragment", "instructions a fragment", "imported", _reader("profile", "alu_per_fragment"))
ALU_ESTIMATE = Measure(
    "ALU per fragment for Adreno 540, Mesa ir3 estimate",
    "operations a fragment",
    "model",
    _reader("model", "compiled", "adreno_540", "alu_per_fragment"),
)
ALU_MODEL = Measure("ALU per fragment", "operations a fragment", "model", _reader("model", "alu_per_fragment"))
NODES = Measure("Nodes fetched", "nodes a pixel", "counted", nodes_a_pixel)
TRIANGLES = Measure("Triangles tested", "triangles a ray", "counted", _reader("per_ray", "triangles"))
PRIMITIVES = Measure("Size of all primitives", "bytes", "counted", _reader("primitive_bytes"))
DEPTH = Measure("Depth of the tree", "levels", "counted", _reader("depth"))

TRAFFIC = (SP_READ, SP_READ_RATE, LINES)
"""Layouts request the same bytes and waste different ones within lines, so that bytes requested cannot stand in."""
MEMORY = (*TRAFFIC, REQUESTED)
ALU = (ALU_IMPORTED, ALU_ESTIMATE, ALU_MODEL)


def choose(section: Section, cells: Iterable[Cell], measures: tuple[Measure, ...]) -> Measure:
    """The first measure that all the cells have that were measured, else the one that most have, else the last."""
    documents = [section.documents[cell] for cell in dict.fromkeys(cells) if cell in section.documents]
    having = [sum(measure.read(document) is not None for document in documents) for measure in measures]
    if not any(having):
        return measures[-1]
    return measures[having.index(max(having))]


def value_of(section: Section, cell: Cell, measure: Measure) -> float | None:
    """A positive figure of a cell; None where there is none."""
    document = section.documents.get(cell)
    value = None if document is None else measure.read(document)
    return value if value is not None and value > 0 else None
