"""A comparison's query string: the whole state of the page and of the API's comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any
from urllib.parse import urlencode

from sqlalchemy import exists, func, null, or_, select
from sqlalchemy.orm import Session
from starlette.datastructures import QueryParams

from renderer.phone_compile.result import COMPILERS
from server.comparison.charts import CHARTS
from server.comparison.filters import NAMES, read_filter, selected
from server.comparison.metrics import COMPILED, DEFAULT_METRIC, METRICS, Metric, require_metric
from server.comparison.pivot import COLUMN_OF, PLACE, CompareError, Comparison, Group, pivot, read_dimensions
from server.comparison.ratios import CLOCKS, with_ratios
from server.comparison.setup_cache import SetupCache, setups_of
from server.comparison.stored_rows import StoredRows, read_rows
from server.store.database import Database
from server.store.models import Json, Result, Study

MAX_CELLS = 220
"""The most cells that a page or an answer shows; a CSV has all."""
MAX_STUDIES = 20
"""The most studies that a page or an answer compares with each other."""
OTHERS = ("metric", "rows", "cols", "columns", "sort", "study", "baseline", "chart", "format", "shape", "cells")


@dataclass(frozen=True)
class Selection:
    """What is compared and how; the defaults are the page without a query string."""

    metric: Metric = METRICS[DEFAULT_METRIC]
    rows: tuple[str, ...] = ("traversal",)
    columns: tuple[str, ...] = ("scene",)
    sort: str = ""
    chart: str = "speed"
    baseline: str = ""
    study: int | None = None
    filters: dict[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def by_study(self) -> bool:
        """Whether studies are compared with each other."""
        return "study" in (*self.rows, *self.columns)

    def query(self, **changes: str) -> str:
        """The query string of this selection with some parameters replaced; defaults are left out."""
        values = {
            "metric": "" if self.metric.key == DEFAULT_METRIC else self.metric.key,
            "rows": "" if self.rows == ("traversal",) else ",".join(self.rows),
            "cols": "" if self.columns == ("scene",) else ",".join(self.columns),
            "sort": self.sort,
            "baseline": self.baseline,
            "chart": "" if self.chart == "speed" else self.chart,
            "study": "" if self.study is None else str(self.study),
        }
        pairs = [(key, value) for key, value in (values | changes).items() if value]
        pairs += [(name, value) for name, chosen in self.filters.items() for value in chosen]
        return urlencode(pairs)


def read_selection(params: QueryParams) -> Selection:
    """Read a query string; raise one of the project's errors, with one sentence, when it is wrong."""
    unknown = [name for name in params if name not in NAMES and name not in OTHERS]
    if unknown:
        raise CompareError(f"Unknown parameter {unknown[0]!r}: choose from {', '.join((*NAMES, *OTHERS))}.")
    chart = params.get("chart") or "speed"
    if chart not in CHARTS:
        raise CompareError(f"Unknown chart {chart!r}: choose one of {', '.join(CHARTS)}.")
    return Selection(
        metric=require_metric(params.get("metric") or DEFAULT_METRIC),
        rows=read_dimensions("rows", params.get("rows") or "traversal"),
        columns=read_dimensions("columns", params.get("cols") or params.get("columns") or "scene"),
        sort=params.get("sort", ""),
        chart=chart,
        baseline=params.get("baseline", ""),
        study=_read_study(params.get("study", "")),
        filters={name: values for name in NAMES if (values := read_filter(name, params.getlist(name)))},
    )


def load_comparison(database: Database, selection: Selection, limit: int | None = MAX_CELLS) -> Comparison:
    """Pivot all selected results; only those that a cell shows are read whole. `limit` is that of `compare.pivot`.

    With a limit and studies on the rows or columns, those are the newest MAX_STUDIES; a note says so.
    """
    with database.reading() as session:
        studies = None if limit is None else _newest_studies(session, selection)
        groups, flat = _read_groups(session, database, selection, studies)
        chosen = (selection.metric, selection.rows, selection.columns, selection.sort)
        whole: dict[int, Json] = {}
        kept = whole if selection.baseline and selection.metric.key in CLOCKS else None
        table = pivot(groups, partial(read_rows, session, whole=kept), flat, *chosen, limit, selection.baseline)
    if table.base:
        table = with_ratios(table, whole)
    if studies is not None:
        table.notes.insert(0, f"Only the newest {MAX_STUDIES} studies are looked at: filter to reach older ones.")
    return table


def load_rows(database: Database, selection: Selection) -> StoredRows:
    """All selected results, the newest first, read from the database when they are asked for."""
    with database.reading() as session:
        return _read_groups(session, database, selection, None)[1]


def known_values(database: Database) -> dict[str, list[str]]:
    """The values that stored results have, per filter."""
    with database.reading() as session:
        return setups_of(database).values(session)


def _newest_studies(session: Session, selection: Selection) -> list[int] | None:
    """The newest studies with a selected result, where studies are compared and there are more; else None."""
    if selection.study is not None or not selection.by_study:
        return None
    there = exists().where(Result.study_id == Study.id, *selected(selection.filters, None))
    found = session.scalars(select(Study.id).where(there).order_by(Study.id.desc()).limit(MAX_STUDIES + 1)).all()
    return None if len(found) <= MAX_STUDIES else list(found[:MAX_STUDIES])


def _read_groups(
    session: Session, database: Database, selection: Selection, studies: Sequence[int] | None
) -> tuple[list[Group], StoredRows]:
    """The selected results by set-up, and by study where studies are compared; of some studies alone where given."""
    within = selected({}, selection.study)
    if studies is not None:
        within.append(or_(Result.study_id.in_(studies), Result.study_id.is_(None)))
    setups = setups_of(database)
    if within or selection.by_study:
        found = _count(session, setups, within, by_study=selection.by_study)
    else:
        # Results are only ever added: as many, up to the same one, are the same ones.
        stamp = tuple(session.execute(select(func.count(), func.max(Result.id)).select_from(Result)).one())
        found = setups.remembered(stamp, lambda: _count(session, setups, within, by_study=False))
    # The filters are of the set-ups, which are in memory.
    chosen = [(PLACE[COLUMN_OF.get(name, name)], set(values)) for name, values in selection.filters.items()]
    if chosen:
        found = [pair for pair in found if all(pair[1].texts[place] in values for place, values in chosen)]
    if _measured_alone(selection):
        found = [pair for pair in found if pair[1].texts[PLACE[COLUMN_OF.get("device", "device")]] != COMPILERS]
        within.append(Result.device != COMPILERS)
    groups = [group for _, group in found]
    count, newest = sum(group.results for group in groups), max((group.latest for group in groups), default=0)
    fields = setups.fields({setup for setup, _ in found})
    conditions = [*selected(selection.filters, None), *within]
    return groups, StoredRows(database, conditions, count, newest, fields)


def _measured_alone(selection: Selection) -> bool:
    """Whether results that were only compiled are left out, as they would hide the measured ones of their cells: unless
    a study or a device is asked for, or one of their own figures."""
    asked = selection.study is not None or "device" in selection.filters
    return not asked and not selection.metric.key.startswith(COMPILED)


def _count(session: Session, setups: SetupCache, within: Sequence[Any], *, by_study: bool) -> list[tuple[int, Group]]:
    """The results within some conditions, by set-up and perhaps study; the query reads an index alone."""
    keys = (Result.setup_id, Result.study_id) if by_study else (Result.setup_id,)
    study = Result.study_id if by_study else null()
    query = select(Result.setup_id, study, func.count(), func.max(Result.id)).where(*within).group_by(*keys)
    rows = session.execute(query).all()
    texts = setups.texts(session, {setup for setup, *_ in rows})
    return [(setup, Group(texts[setup], number, count, latest)) for setup, number, count, latest in rows]


def _read_study(text: str) -> int | None:
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) < 2**63):
        raise CompareError(f"The study {text!r} is not understood: give its number.")
    return int(text)
