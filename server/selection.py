"""A comparison's query string: the whole state of the page and of the API's comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from urllib.parse import urlencode

from sqlalchemy import select
from starlette.datastructures import QueryParams

from renderer.variant import AXES, expand
from server.compare import CompareError, Comparison, compare, read_dimensions
from server.flat import Stored
from server.metrics import DEFAULT_METRIC, METRICS, Metric, require_metric
from server.store.database import Database
from server.store.models import FILTERS, Job, Result

MAX_RESULTS = 5000
CHARTS = ("speed", "error")
OTHERS = ("metric", "rows", "cols", "columns", "sort", "study", "chart", "format", "shape")


@dataclass(frozen=True)
class Selection:
    """What is compared and how; the defaults are the page without a query string."""

    metric: Metric = METRICS[DEFAULT_METRIC]
    rows: tuple[str, ...] = ("traversal",)
    columns: tuple[str, ...] = ("scene",)
    sort: str = ""
    chart: str = "speed"
    study: int | None = None
    filters: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def query(self, **changes: str) -> str:
        """The query string of this selection with some parameters replaced; defaults are left out."""
        values = {
            "metric": "" if self.metric.key == DEFAULT_METRIC else self.metric.key,
            "rows": "" if self.rows == ("traversal",) else ",".join(self.rows),
            "cols": "" if self.columns == ("scene",) else ",".join(self.columns),
            "sort": self.sort,
            "chart": "" if self.chart == "speed" else self.chart,
            "study": "" if self.study is None else str(self.study),
        }
        pairs = [(key, value) for key, value in (values | changes).items() if value]
        pairs += [(name, value) for name, chosen in self.filters.items() for value in chosen]
        return urlencode(pairs)


def read_selection(params: QueryParams) -> Selection:
    """Read a query string; raise one of the project's errors, with one sentence, when it is wrong."""
    unknown = [name for name in params if name not in FILTERS and name not in OTHERS]
    if unknown:
        raise CompareError(f"Unknown parameter {unknown[0]!r}: choose from {', '.join((*FILTERS, *OTHERS))}.")
    chart = params.get("chart") or "speed"
    if chart not in CHARTS:
        raise CompareError(f"Unknown chart {chart!r}: choose one of {', '.join(CHARTS)}.")
    return Selection(
        metric=require_metric(params.get("metric") or DEFAULT_METRIC),
        rows=read_dimensions("rows", params.get("rows") or "traversal"),
        columns=read_dimensions("columns", params.get("cols") or params.get("columns") or "scene"),
        sort=params.get("sort", ""),
        chart=chart,
        study=_read_study(params.get("study", "")),
        filters={name: values for name in FILTERS if (values := _read_filter(name, params.getlist(name)))},
    )


def load_comparison(database: Database, selection: Selection) -> Comparison:
    """Read the selected results, the newest first, and pivot them."""
    results = load_results(database, selection)
    table = compare(results[:MAX_RESULTS], selection.metric, selection.rows, selection.columns, selection.sort)
    if len(results) > MAX_RESULTS:
        table.notes.append(f"Only the latest {MAX_RESULTS} results are looked at: filter to reach older ones.")
    return table


def load_results(database: Database, selection: Selection) -> list[Stored]:
    """The selected results, the newest first, at most one more than MAX_RESULTS."""
    query = select(Result, Job.study_id).join(Job).order_by(Result.recorded_at.desc(), Result.id.desc())
    for name, values in selection.filters.items():
        query = query.where(getattr(Result, name).in_(values))
    if selection.study is not None:
        query = query.where(Job.study_id == selection.study)
    with database.reading() as session:
        return [
            Stored(result.job_id, study, result.recorded_at.isoformat(), result.document)
            for result, study in session.execute(query.limit(MAX_RESULTS + 1))
        ]


def known_values(database: Database) -> dict[str, list[str]]:
    """The values that stored results have, per filter."""
    with database.reading() as session:
        return {name: sorted(session.scalars(select(getattr(Result, name)).distinct())) for name in FILTERS}


def _read_filter(name: str, values: Sequence[str]) -> tuple[str, ...]:
    given = [value for value in values if value]
    if name in AXES:
        return expand(name, ",".join(given)) if given else ()
    return tuple(dict.fromkeys(given))


def _read_study(text: str) -> int | None:
    if not text:
        return None
    if not (text.isascii() and text.isdigit() and int(text) < 2**63):
        raise CompareError(f"The study {text!r} is not understood: give its number.")
    return int(text)
