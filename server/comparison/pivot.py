"""The comparison: results pivoted into rows and columns, every cell one result with all its figures.

Results are never averaged. Where several fall into one cell the latest is shown, with how many there are and in what
they differ, so that figures of different environments are not mistaken for one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import compress
from operator import itemgetter, ne
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from renderer.variant import AXES, TRAVERSALS
from server.comparison.derived import DERIVED, derived_texts
from server.comparison.flat import Stored, flatten, to_frame, without_raw
from server.comparison.metrics import Figure, Metric, read_figures
from server.comparison.ratios import Ratio
from server.store.setups import FACTS, SETUP, VERSIONS

if TYPE_CHECKING:
    import pandas as pd

DIMENSIONS = (*AXES, *DERIVED, "scene", "family", "device", "size", "rays", "study")
"""What may stand on the rows and the columns."""

COLUMN_OF = {"device": "device_id", "rays": "rays_kind"}
"""Dimensions whose column in a flat row has another name."""

PLACE = {name: index for index, name in enumerate((*FACTS, *DERIVED))}

Key = tuple[str, ...]
Texts = tuple[str, ...]
Row = dict[str, Any]
Load = Callable[[Sequence[int]], dict[int, Row]]


class Rows(Protocol):
    """Flat rows, the newest first; they may be read from the store as they are asked for."""

    def __len__(self) -> int:
        """How many."""
        ...

    def __iter__(self) -> Iterator[Row]:
        """Read them."""
        ...


class CompareError(ValueError):
    """A comparison that cannot be made; the message is one sentence that says what to do."""


class Group(NamedTuple):
    """Results of one set-up: its texts as `texts_of` gives them, how many results, and the newest (the largest id)."""

    texts: Texts
    study: int | None
    results: int
    latest: int


@dataclass(frozen=True)
class Cell:
    """The latest result of a cell: its flat row without raw series, all figures, the count, what they differ in.

    `ratio` is its figure by that of the baseline's row; None where no baseline is chosen.
    """

    row: dict[str, Any]
    figures: dict[str, Figure]
    count: int
    differs: tuple[str, ...]
    ratio: Ratio | None = None


@dataclass(frozen=True)
class Comparison:
    """A table: `cells[i][j]` belongs to `row_keys[i]` and `column_keys[j]`; None where nothing was measured.

    `flat` is every result that went in; `environments` are their devices, drivers included, each once. `base` are the
    cells of the row that is the baseline, which may be one that is not shown; empty where there is none.
    """

    metric: Metric
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    row_keys: list[Key]
    column_keys: list[Key]
    cells: list[list[Cell | None]]
    notes: list[str]
    flat: Rows
    environments: list[str]
    base: list[Cell | None] = field(default_factory=list)

    def frame(self) -> pd.DataFrame:
        """All results that went in, one a line, the newest first."""
        return to_frame(list(self.flat))

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
    groups = [Group(texts_of(row), row["study"], 1, -index) for index, row in enumerate(flat)]
    return pivot(groups, lambda ids: {id_: without_raw(flat[-id_]) for id_ in ids}, flat, metric, rows, columns, sort)


def pivot(
    groups: Iterable[Group],
    load: Load,
    flat: Rows,
    metric: Metric,
    rows: tuple[str, ...],
    columns: tuple[str, ...],
    sort: str = "",
    limit: int | None = None,
    baseline: str = "",
) -> Comparison:
    """Pivot groups of results; `load` gives the flat rows of results by their ids.

    With a `limit` the table has no more cells than that, beyond one row and one column; a note says what is left out.
    `baseline` is a row's label, whose cells are then given as `base`.
    """
    known = list(groups)
    pairs = _by_cell(known, rows, columns)
    table = _Table(pairs, load)
    row_keys = _ordered({row_key for row_key, _ in pairs}, rows)
    column_keys = _ordered({column_key for _, column_key in pairs}, columns)
    row_keys = _sorted(row_keys, column_keys, table, metric, rows, sort)
    shown_columns = column_keys[:limit]
    shown_rows = row_keys if limit is None else row_keys[: max(1, limit // max(1, len(shown_columns)))]
    table.read((row, column) for row in shown_rows for column in shown_columns)
    cells = [[table.cells.get((row, column)) for column in shown_columns] for row in shown_rows]
    notes = _left_out(row_keys, column_keys, shown_rows, shown_columns) + _differing(table.differs)
    notes += _modelled(metric, cells)
    base = next((key for key in row_keys if label(key) == baseline), None) if baseline else None
    if baseline and row_keys and base is None:
        notes.insert(0, f"There is no row {baseline!r} to be the baseline: choose one of the table's.")
    environments = _environments(known)
    found = _row(table, base, shown_columns) if base else []
    return Comparison(metric, rows, columns, shown_rows, shown_columns, cells, notes, flat, environments, found)


def texts_of(facts: dict[str, Any]) -> Texts:
    """A set-up's facts, or those of a flat row, as texts in the order of FACTS and DERIVED."""
    return (*(str(facts.get(name)) for name in FACTS), *derived_texts(facts))


def read_dimensions(name: str, text: str) -> tuple[str, ...]:
    """Read a comma list of dimensions for `name` (rows or columns)."""
    chosen = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    for word in chosen:
        if word not in DIMENSIONS:
            raise CompareError(f"Unknown {name} {word!r}: choose from {', '.join(DIMENSIONS)}.")
    if not chosen:
        raise CompareError(f"The {name} are empty: choose from {', '.join(DIMENSIONS)}.")
    return chosen


def label(key: Key) -> str:
    """A key as one text."""
    return " / ".join(key)


class _Table:
    """The cells of a table, made when they are asked for, and what the results of each cell differ in."""

    def __init__(self, pairs: dict[tuple[Key, Key], list[Group]], load: Load) -> None:
        self._pairs = pairs
        self._load = load
        self.differs = {pair: _differs(groups) for pair, groups in pairs.items()}
        self.cells: dict[tuple[Key, Key], Cell] = {}

    def read(self, wanted: Iterable[tuple[Key, Key]]) -> None:
        """Make the cells that have results and are not made yet."""
        new = [pair for pair in wanted if pair in self._pairs and pair not in self.cells]
        latest = {pair: max(group.latest for group in self._pairs[pair]) for pair in new}
        found = self._load(list(latest.values()))
        for pair, id_ in latest.items():
            row, count = found[id_], sum(group.results for group in self._pairs[pair])
            self.cells[pair] = Cell(row, read_figures(row), count, self.differs[pair])


def _by_cell(groups: list[Group], rows: Sequence[str], columns: Sequence[str]) -> dict[tuple[Key, Key], list[Group]]:
    row_of, column_of = _key_maker(rows), _key_maker(columns)
    pairs = defaultdict(list)
    for group in groups:
        pairs[row_of(group), column_of(group)].append(group)
    return pairs


def _key_maker(dimensions: Sequence[str]) -> Callable[[Group], Key]:
    """What makes a group's key; called for every group, so it does little."""
    if "study" in dimensions:
        places = [-1 if name == "study" else PLACE[COLUMN_OF.get(name, name)] for name in dimensions]
        return lambda group: tuple(str(group.study) if place < 0 else group.texts[place] for place in places)
    places = [PLACE[COLUMN_OF.get(name, name)] for name in dimensions]
    if len(places) == 1:
        return lambda group: (group.texts[places[0]],)
    chosen = itemgetter(*places)
    return lambda group: chosen(group.texts)


def _differs(groups: list[Group]) -> tuple[str, ...]:
    if len(groups) == 1:
        return ()
    first, *others = (group.texts for group in groups)
    varying: set[str] = set()
    for texts in others:
        varying.update(compress(PLACE, map(ne, first, texts)))
    return tuple(name for name in SETUP if name in varying) or tuple(name for name in VERSIONS if name in varying)


def _environments(groups: Iterable[Group]) -> list[str]:
    """The devices with their drivers, the one of the newest result first."""
    newest: dict[Texts, int] = {}
    device = itemgetter(*(PLACE[f"device_{part}"] for part in ("name", "id", "driver")))
    for group in groups:
        key = device(group.texts)
        newest[key] = max(group.latest, newest.get(key, group.latest))
    ordered = sorted(newest, key=lambda key: -newest[key])
    return list(dict.fromkeys(f"{id_ if name in ('', 'None') else name}, {driver}" for name, id_, driver in ordered))


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
    table: _Table,
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
    table.read((key, column) for key in row_keys)

    def value(key: Key) -> tuple[bool, float]:
        cell = table.cells.get((key, column))
        found = cell.figures[metric.key].value if cell else None
        return (found is None, 0.0 if found is None else -found if falling else found)

    return sorted(row_keys, key=value)


def _left_out(
    rows: Sequence[Key], columns: Sequence[Key], shown_rows: Sequence[Key], shown: Sequence[Key]
) -> list[str]:
    if len(rows) == len(shown_rows) and len(columns) == len(shown):
        return []
    return [
        f"The table has {len(rows)} rows and {len(columns)} columns: the first {len(shown_rows)} rows and {len(shown)} "
        "columns are shown. Filter, or put less on the rows or columns; the CSV has all of it."
    ]


def _row(table: _Table, row: Key, columns: Sequence[Key]) -> list[Cell | None]:
    table.read((row, column) for column in columns)
    return [table.cells.get((row, column)) for column in columns]


def _modelled(metric: Metric, cells: Sequence[Sequence[Cell | None]]) -> list[str]:
    """What the shown figures' models say about themselves, where the metric is one."""
    texts = dict.fromkeys(str(cell.row.get(metric.model) or "") for line in cells for cell in line if cell)
    return [f"{metric.label}: {text}" for text in texts if text] if metric.model else []


def _differing(differs: dict[tuple[Key, Key], tuple[str, ...]]) -> list[str]:
    crowded = [names for names in differs.values() if names]
    if not crowded:
        return []
    found = sorted({name for names in crowded for name in names}, key=(*SETUP, *VERSIONS).index)
    return [
        f"{len(crowded)} of {len(differs)} cells hold several results that differ in {', '.join(found)}; "
        "each shows the latest. Filter, or put these on the rows or columns."
    ]
