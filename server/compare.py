"""The comparison: results pivoted into rows and columns, every cell one result with all its figures.

Results are never averaged. Where several fall into one cell the latest is shown, with how many there are and in what
they differ, so that figures of different environments are not mistaken for one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from renderer.variant import AXES, TRAVERSALS
from server.flat import Stored, flatten, to_frame
from server.metrics import METRICS, Figure, Metric, read_figure

if TYPE_CHECKING:
    import pandas as pd

DIMENSIONS = (*AXES, "scene", "family", "device", "size", "rays", "study")
"""What may stand on the rows and the columns."""

COLUMN_OF = {"device": "device_id", "rays": "rays_kind"}
"""Dimensions whose column in a flat row has another name."""

SETUP = (
    *AXES,
    *("scene", "device_id", "device_name", "device_driver", "device_threads", "size", "rays_kind", "specialised"),
    *("sah_traversal", "sah_intersection"),
)
"""What two results of one cell may differ in."""

VERSIONS = ("versions_rayfarm", "versions_plan", "versions_shader_sha")
"""What else they may differ in; named where the set-up does not explain it."""

Key = tuple[str, ...]


class CompareError(ValueError):
    """A comparison that cannot be made; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Cell:
    """The latest result of a cell: its flat row, all figures, how many results there are, what they differ in."""

    row: dict[str, Any]
    figures: dict[str, Figure]
    count: int
    differs: tuple[str, ...]


@dataclass(frozen=True)
class Comparison:
    """A table: `cells[i][j]` belongs to `row_keys[i]` and `column_keys[j]`; None where nothing was measured."""

    metric: Metric
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    row_keys: list[Key]
    column_keys: list[Key]
    cells: list[list[Cell | None]]
    notes: list[str]
    flat: list[dict[str, Any]]

    def frame(self) -> pd.DataFrame:
        """All results that went in, one a line, the newest first."""
        return to_frame(self.flat)

    def pivot(self) -> pd.DataFrame:
        """The metric's values as a table of rows by columns."""
        import pandas as pd

        values = [[cell and cell.figures[self.metric.key].value for cell in line] for line in self.cells]
        index = pd.Index([label(key) for key in self.row_keys], name="_".join(self.rows))
        return pd.DataFrame(values, index=index, columns=[label(key) for key in self.column_keys])


def compare(
    results: Sequence[Stored],
    metric: Metric,
    rows: tuple[str, ...] = ("traversal",),
    columns: tuple[str, ...] = ("scene",),
    sort: str = "",
) -> Comparison:
    """Pivot results, given newest first.

    `sort` is empty (the axes' own order), a row dimension, or a column's label: then the best comes first; with a
    `-` before it the order is reversed.
    """
    flat = [flatten(stored) for stored in results]
    groups: dict[tuple[Key, Key], list[dict[str, Any]]] = {}
    for row in flat:
        groups.setdefault((key_of(row, rows), key_of(row, columns)), []).append(row)
    row_keys = _ordered({row_key for row_key, _ in groups}, rows)
    column_keys = _ordered({column_key for _, column_key in groups}, columns)
    table = {pair: _cell(group) for pair, group in groups.items()}
    row_keys = _sorted(row_keys, column_keys, table, metric, rows, sort)
    cells = [[table.get((row, column)) for column in column_keys] for row in row_keys]
    return Comparison(metric, rows, columns, row_keys, column_keys, cells, _notes(table), flat)


def read_dimensions(name: str, text: str) -> tuple[str, ...]:
    """Read a comma list of dimensions for `name` (rows or columns)."""
    chosen = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    for word in chosen:
        if word not in DIMENSIONS:
            raise CompareError(f"Unknown {name} {word!r}: choose from {', '.join(DIMENSIONS)}.")
    if not chosen:
        raise CompareError(f"The {name} are empty: choose from {', '.join(DIMENSIONS)}.")
    return chosen


def key_of(row: dict[str, Any], dimensions: Sequence[str]) -> Key:
    """A flat row's place on the given dimensions."""
    return tuple(str(row.get(COLUMN_OF.get(name, name))) for name in dimensions)


def label(key: Key) -> str:
    """A key as one text."""
    return " / ".join(key)


def _cell(group: list[dict[str, Any]]) -> Cell:
    latest = group[0]
    differs = tuple(name for name in SETUP if _varies(group, name)) or tuple(v for v in VERSIONS if _varies(group, v))
    return Cell(latest, {key: read_figure(metric, latest) for key, metric in METRICS.items()}, len(group), differs)


def _varies(group: list[dict[str, Any]], name: str) -> bool:
    return len({str(row.get(name)) for row in group}) > 1


def _ordered(keys: set[Key], dimensions: Sequence[str]) -> list[Key]:
    def place(key: Key) -> list[tuple[int, str]]:
        return [_rank(name, value) for name, value in zip(dimensions, key, strict=True)]

    return sorted(keys, key=place)


def _rank(dimension: str, value: str) -> tuple[int, str]:
    order = tuple(TRAVERSALS) if dimension == "traversal" else AXES.get(dimension, ())
    return (order.index(value) if value in order else len(order), value)


def _sorted(
    row_keys: list[Key],
    column_keys: list[Key],
    table: dict[tuple[Key, Key], Cell],
    metric: Metric,
    rows: Sequence[str],
    sort: str,
) -> list[Key]:
    wanted = sort.removeprefix("-")
    if wanted in rows:
        return sorted(row_keys, key=lambda key: key[rows.index(wanted)], reverse=sort != wanted)
    column = next((key for key in column_keys if label(key) == wanted), None)
    if column is None:
        return row_keys
    falling = (metric.better == "higher") != sort.startswith("-")

    def value(key: Key) -> tuple[bool, float]:
        cell = table.get((key, column))
        found = cell.figures[metric.key].value if cell else None
        return (found is None, 0.0 if found is None else -found if falling else found)

    return sorted(row_keys, key=value)


def _notes(table: dict[tuple[Key, Key], Cell]) -> list[str]:
    crowded = [cell for cell in table.values() if cell.differs]
    if not crowded:
        return []
    names = sorted({name for cell in crowded for name in cell.differs}, key=(*SETUP, *VERSIONS).index)
    return [
        f"{len(crowded)} of {len(table)} cells hold several results that differ in {', '.join(names)}; "
        "each shows the latest. Filter, or put these on the rows or columns."
    ]
