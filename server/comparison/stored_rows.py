"""Stored results as flat rows, read from the database a page at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from server.comparison.flat import Stored, flatten, without_raw
from server.comparison.pivot import Row
from server.store.database import Database
from server.store.models import Json, Result

PAGE = 500
COLUMNS = (Result.id, Result.job_id, Result.study_id, Result.recorded_at, Result.document)


def read_rows(session: Session, ids: Sequence[int]) -> dict[int, Row]:
    """The flat rows of results by their ids, without raw series."""
    found: dict[int, Row] = {}
    for first in range(0, len(ids), PAGE):
        found |= _rows(session, select(*COLUMNS).where(Result.id.in_(ids[first : first + PAGE])), raw=False)
    return found


def selected(filters: Mapping[str, Sequence[str]], study: int | None) -> list[Any]:
    """The conditions for results of a study with one of the given values in every filtered column."""
    conditions: list[Any] = [getattr(Result, name).in_(values) for name, values in filters.items()]
    return conditions if study is None else [*conditions, Result.study_id == study]


class StoredRows:
    """The rows that fulfil conditions, up to the result with the id `newest`, as often as they are asked for.

    `fields` are the columns that they have beside those of every table. Every page is a transaction of its own, so that
    a slow reader holds none; results are only ever added.
    """

    def __init__(
        self, database: Database, conditions: Sequence[Any], count: int, newest: int, fields: Sequence[str]
    ) -> None:
        self.fields = fields
        self._database = database
        self._conditions = conditions
        self._count = count
        self._newest = newest

    def __len__(self) -> int:
        """How many results."""
        return self._count

    def __iter__(self) -> Iterator[Row]:
        """Read them, the newest first."""
        before = self._newest + 1
        page = select(*COLUMNS).where(*self._conditions).order_by(Result.id.desc()).limit(PAGE)
        while True:
            with self._database.reading() as session:
                found = _rows(session, page.where(Result.id < before))
            yield from found.values()
            if len(found) < PAGE:
                return
            before = min(found)


def _rows(session: Session, query: Select[int, int, int | None, datetime, Json], *, raw: bool = True) -> dict[int, Row]:
    return {
        number: flatten(Stored(job, study, at.isoformat(), document if raw else without_raw(document)))
        for number, job, study, at, document in session.execute(query)
    }
