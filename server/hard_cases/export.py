"""A study's cells as flat rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from server.hard_cases.words import counts_of

Json = dict[str, Any]
BEFORE, AFTER = ("family",), ("outcome", "sentence", "rays", "t_ulp_max", "cost", "fitted")


def columns_of(document: Json) -> list[str]:
    """The columns of a study's cells: the family, the variant's axes, the figures, the counts, the promises broken."""
    cells = document["cells"]
    counts = dict.fromkeys(name for cell in cells for name in counts_of(cell))
    return [*BEFORE, *cells[0]["variant"], *AFTER, *counts, "broken", "seed"]


def cell_rows(document: Json) -> Iterator[Json]:
    """Its cells in those columns."""
    columns = columns_of(document)
    for cell in document["cells"]:
        flat = cell["variant"] | cell | {"broken": "; ".join(cell["broken"])}
        yield {name: flat.get(name) for name in columns}
