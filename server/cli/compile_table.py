"""Estimates of phone GPUs as a table in the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from renderer.variant import AXES

Json = dict[str, Any]
UNKNOWN = "–"
ALWAYS = ("traversal", "method", "layout")

COLUMNS = (
    ("instr", "instructions"),
    ("ALU/frag", "alu_per_fragment"),
    ("mem/frag", "memory_per_fragment"),
    ("ALU/ray", "alu_per_ray"),
    ("mem/ray", "memory_per_ray"),
    ("B/ray", "bytes_per_ray"),
    ("regs", "registers"),
    ("waves", "waves"),
    ("spills", "spills"),
    ("loops", "loops"),
)


def print_estimates(headline: Sequence[str], documents: Sequence[Json], console: Console) -> None:
    """Print a row for each variant and GPU, and below them what they are and what is missing."""
    axes = [axis for axis in AXES if axis in ALWAYS or len({document[axis] for document in documents}) > 1]
    table = Table(box=None, pad_edge=False)
    for axis in (*axes, "gpu"):
        table.add_column(axis, no_wrap=True)
    for head, _ in COLUMNS:
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("bound by", no_wrap=True)
    for document in documents:
        for row in document["gpus"]:
            bound = row["roofline"]["bound"] if row["roofline"] else UNKNOWN
            figures = (_figure(row[name]) for _, name in COLUMNS)
            table.add_row(*(Text(document[axis]) for axis in axes), row["gpu"], *figures, bound)
    for line in headline:
        console.print(Text(line))
    console.print(table)
    rows = [row for document in documents for row in document["gpus"]]
    for sentence in dict.fromkeys(_notes(rows)):
        console.print(Text(sentence, style="yellow"), soft_wrap=True)
    for label in dict.fromkeys(f"{row['label']}, Mesa {row['mesa']}" for row in rows):
        console.print(Text(f"{label}: not a measurement, and not the vendor's compiler.", style="dim"))


def _notes(rows: Sequence[Json]) -> list[str]:
    limits = [f"Limit: {row['limit']}" for row in rows if row["limit"]]
    return [*limits, *(f"{row['gpu']}: {row['reason']}" for row in rows if row["reason"])]


def _figure(value: float | None) -> str:
    if value is None:
        return UNKNOWN
    return f"{value:,.0f}" if isinstance(value, int) or value >= 100 else f"{value:.1f}"
