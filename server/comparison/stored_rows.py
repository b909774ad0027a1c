"""Stored results as flat rows, read from the database a page at a time."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from datetime import datetime
from itertools import islice
from typing import Any

from sqlalchemy import Text, cast, select
from sqlalchemy.orm import Session

from server.comparison.flat import LINES, Stored, flatten, without_raw
from server.comparison.pivot import Row
from server.store.database import Database
from server.store.models import Json, Result

PAGE = 500
KNOWN = (Result.id, Result.job_id, Result.study_id, Result.recorded_at)
TEXTS = (*KNOWN, cast(Result.document, Text))

# Most of a document is its frames. Within a JSON text a quote has a backslash before it, so this matches no text.
_FRAMES = re.compile(r'("frames_(?:cpu_|gpu_)?ms": *)(\[[^\[\]{}"]*\])')


def read_rows(session: Session, ids: Sequence[int], whole: dict[int, Json] | None = None) -> dict[int, Row]:
    """The flat rows of results by their ids, without raw series; `whole` is given their documents, by their jobs."""
    found: dict[int, Row] = {}
    for first in range(0, len(ids), PAGE):
        query = select(*TEXTS).where(Result.id.in_(ids[first : first + PAGE]))
        for number, job, study, at, text in session.execute(query):
            document = json.loads(text if whole is not None else _FRAMES.sub(r"\1[]", text))
            found[number] = flatten(Stored(job, study, at.isoformat(), without_raw(document)))
            if whole is not None:
                whole[job] = document
    return found


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
        return self.rows()

    def rows(self, *, lists: bool = False) -> Iterator[Row]:
        """Read them, the newest first, with lists as JSON text or as they are."""
        for _, job, study, at, text in self._read(*TEXTS):
            # Frames that are written as JSON text need not be read.
            document = json.loads(text if lists else _FRAMES.sub(r'\1"\2"', text))
            yield flatten(Stored(job, study, at.isoformat(), document), lists=lists)

    def json_lines(self) -> Iterator[str]:
        """The whole results, the newest first, one a line, each with its `job`, `study` and `recorded_at`.

        Some lines come at once: a response takes longer for a piece than for a line.
        """
        found = self._read(*TEXTS)
        while lines := [_json_line(*row) for row in islice(found, LINES)]:
            yield "".join(lines)

    def _read(self, *columns: Any) -> Iterator[Any]:
        before = self._newest + 1
        page = select(*columns).where(*self._conditions).order_by(Result.id.desc()).limit(PAGE)
        while True:
            with self._database.reading() as session:
                found = session.execute(page.where(Result.id < before)).all()
            yield from found
            if len(found) < PAGE:
                return
            before = found[-1][0]


def _json_line(_: int, job: int, study: int | None, at: datetime, text: str) -> str:
    known = json.dumps({"job": job, "study": study, "recorded_at": at.isoformat()})
    # In JSON a line's end can only stand between words.
    return f"{known[:-1]}, {text.replace(chr(10), ' ').strip()[1:]}\n"
