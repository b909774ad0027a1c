"""A study's cells as a table of families by variants, or by variants that are alike on the axes in view."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import quote, urlencode

from renderer.variant import AXES
from server.hard_cases.words import BAD, count_name, counts_of, write_cost, write_ulps

Json = dict[str, Any]
Key = tuple[str, ...]
Kind = Literal["right", "lost", "broken", "refused", "absent"]
MOST_COLUMNS = 60
LOST = ("crashed", "hung")
BY_DEFAULT_MERGED = "traversal"
ALL, LOSSES = "all", "losses"
OTHERS = ("cols", "show", "download")


class HardCaseError(ValueError):
    """A table that cannot be made; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class View:
    """The query string of a run's page: the axes that tell columns apart, the rows shown, the values kept."""

    columns: Key
    show: str
    filters: Mapping[str, Key]

    def query(self) -> str:
        """The query string."""
        pairs = [("cols", ",".join(self.columns)), *([("show", self.show)] if self.show != ALL else [])]
        return urlencode([*pairs, *((axis, value) for axis, values in self.filters.items() for value in values)])


@dataclass(frozen=True)
class CellView:
    """What a cell shows: what was wrong, line by line, and its smaller figures. `of` is how many variants it merges."""

    kind: Kind
    lines: list[str]
    detail: list[str]
    said: str
    of: int


@dataclass(frozen=True)
class RowView:
    """A family with its cells; `address` ends the address of the page that has every figure of it."""

    name: str
    reason: str
    source: str
    rays: int
    address: str
    cells: list[CellView]


@dataclass(frozen=True)
class Matrix:
    """The table: `heads` are the columns' values on the axes `axes`; `notes` say what is left out."""

    axes: Key
    heads: list[Key]
    rows: list[RowView]
    notes: list[str]
    counts: dict[Kind, int]


def axes_of(cells: Iterable[Json]) -> dict[str, list[str]]:
    """The axes on which a study's variants differ, with their values in the axes' own order."""
    values: dict[str, set[str]] = defaultdict(set)
    for cell in cells:
        for axis, value in cell["variant"].items():
            values[axis].add(value)
    return {
        axis: sorted(found, key=lambda value: _rank(axis, value)) for axis, found in values.items() if len(found) > 1
    }


def read_view(axes: Mapping[str, Sequence[str]], asked: Iterable[tuple[str, str]]) -> View:
    """Read a query string's pairs; raise HardCaseError with one sentence when it is wrong."""
    columns, show = tuple(axis for axis in axes if axis != BY_DEFAULT_MERGED), ALL
    filters: dict[str, list[str]] = defaultdict(list)
    for name, value in asked:
        if name == "cols":
            columns = tuple(dict.fromkeys(word for word in value.split(",") if word))
        elif name == "show":
            show = value
        elif name in axes:
            filters[name].append(value)
        elif name not in OTHERS:
            raise HardCaseError(f"Unknown parameter {name!r}: choose from {', '.join((*axes, *OTHERS[:2]))}.")
    wrong = [word for word in columns if word not in axes]
    if wrong:
        raise HardCaseError(f"Unknown columns {wrong[0]!r}: choose from {', '.join(axes)}.")
    if show not in (ALL, LOSSES):
        raise HardCaseError(f"Unknown rows {show!r}: choose one of {ALL}, {LOSSES}.")
    return View(columns, show, {axis: tuple(dict.fromkeys(values)) for axis, values in filters.items()})


def chosen(cells: Iterable[Json], view: View) -> list[Json]:
    """The cells whose variants have the kept values."""
    return [cell for cell in cells if all(cell["variant"][axis] in kept for axis, kept in view.filters.items())]


def make_matrix(document: Json, view: View, most: int = MOST_COLUMNS) -> Matrix:
    """The table of a study's chosen cells, families in the study's order."""
    groups: dict[str, dict[Key, list[Json]]] = defaultdict(lambda: defaultdict(list))
    heads: set[Key] = set()
    for cell in chosen(document["cells"], view):
        key = tuple(cell["variant"][axis] for axis in view.columns)
        heads.add(key)
        groups[cell["family"]][key].append(cell)
    ordered = sorted(heads, key=lambda key: [_rank(axis, value) for axis, value in zip(view.columns, key, strict=True)])
    shown = ordered[:most]
    notes = (
        [] if len(ordered) <= most else [f"{len(ordered)} columns, of which {most} are shown: filter, or merge axes."]
    )
    rows = [_row(family, groups[family["name"]], shown) for family in document["families"] if family["name"] in groups]
    if view.show == LOSSES:
        rows = [row for row in rows if any(cell.kind in ("lost", "broken") for cell in row.cells)]
    kinds = [cell.kind for row in rows for cell in row.cells]
    counts = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}
    return Matrix(view.columns, shown, rows, notes, counts)


def kind_of(cells: Sequence[Json]) -> Kind:
    """The worst that is to be said of cells."""
    if not cells:
        return "absent"
    if any(cell["broken"] or cell["outcome"] in LOST for cell in cells):
        return "broken"
    if all(cell["outcome"] != "ran" for cell in cells):
        return "refused"
    return "lost" if any(cell.get(name) for cell in cells for name in BAD) else "right"


def _row(family: Json, groups: Mapping[Key, list[Json]], heads: Sequence[Key]) -> RowView:
    rays = max(cell["rays"] for cells in groups.values() for cell in cells)
    cells = [_cell(groups.get(key, [])) for key in heads]
    return RowView(family["name"], family["reason"], family["source"], rays, quote(family["name"], safe=""), cells)


def _cell(cells: Sequence[Json]) -> CellView:
    ran = [cell for cell in cells if cell["outcome"] == "ran"]
    others = [cell for cell in cells if cell["outcome"] != "ran"]
    lines = [f"{cell['outcome']}: {_traversal(cell)}" for cell in others if cell["outcome"] in LOST]
    lines += [text for name in BAD if (text := _counted(ran, name))]
    if any(cell["fitted"] is False for cell in ran):
        lines.append("specialised text differs")
    said = " ".join(dict.fromkeys(f"{cell['outcome'].capitalize()}: {cell['sentence']}" for cell in others))
    return CellView(kind_of(cells), lines, _detail(ran), said, len(cells))


def _detail(ran: Sequence[Json]) -> list[str]:
    known = BAD
    others = [name for name in (counts_of(ran[0]) if ran else ()) if name not in known and name != "spawned"]
    ulps = [cell["t_ulp_max"] for cell in ran if cell["t_ulp_max"] is not None]
    costs = [cell["cost"] for cell in ran if cell["cost"] is not None]
    return [
        *(text for name in others if (text := _counted(ran, name))),
        *([f"t {write_ulps(max(ulps))}"] if ulps else []),
        *([f"cost {write_cost(max(costs))}"] if costs else []),
    ]


def _counted(ran: Sequence[Json], name: str) -> str:
    """A count from least to most; what "any hit" gets wrong is told where the closest hit does not as well."""
    counts = sorted({cell.get(name) or 0 for cell in ran})
    twin = name.removeprefix("any_")
    if not counts or not counts[-1]:
        return ""
    if twin != name and all(cell.get(name) == cell.get(twin) for cell in ran):
        return ""
    return f"{'–'.join(f'{count:,}' for count in dict.fromkeys((counts[0], counts[-1])))} {count_name(name)}"


def _traversal(cell: Json) -> str:
    return str(cell["variant"].get("traversal", cell["label"]))


def _rank(axis: str, value: str) -> tuple[int, str]:
    order = AXES.get(axis, ())
    return (order.index(value) if value in order else len(order), value)
