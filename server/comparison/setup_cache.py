"""All set-ups of a database in memory: they are never changed, so each is read once a process; their counts, too."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Callable, Collection, Iterable, Mapping
from weakref import WeakKeyDictionary

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from server.comparison.filters import NAMES
from server.comparison.pivot import COLUMN_OF, PLACE, Group, Texts, texts_of
from server.store.database import Database
from server.store.models import Setup

MANY = 500
"""How many missing set-ups are asked for by their ids; more are read with all others."""

Stamp = tuple[int | None, ...]
Counted = list[tuple[int, Group]]


class SetupCache:
    """Set-ups by their ids; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._texts: dict[int, Texts] = {}
        self._fields: dict[int, tuple[str, ...]] = {}
        self._counted: tuple[Stamp, Counted] | None = None
        self._values: dict[str, set[str]] = {name: set() for name in NAMES}

    def texts(self, session: Session, wanted: Collection[int]) -> Mapping[int, Texts]:
        """At least the wanted set-ups, which must exist."""
        with self._lock:
            missing = [number for number in wanted if number not in self._texts]
            if missing:
                self._read(session, missing)
        return self._texts

    def fields(self, wanted: Iterable[int]) -> list[str]:
        """The columns that results of these set-ups have beside those of every table; they were read before."""
        different = {self._fields[number] for number in wanted}
        return list(dict.fromkeys(name for fields in sorted(different) for name in fields))

    def remembered(self, stamp: Stamp, count: Callable[[], Counted]) -> Counted:
        """What `count` gives, asked again only when the stamp is another; not to be changed."""
        kept = self._counted
        if kept is None or kept[0] != stamp:
            kept = self._counted = (stamp, count())
        return kept[1]

    def values(self, session: Session) -> dict[str, list[str]]:
        """The values that set-ups have, per filter, in order."""
        with self._lock:
            # A process that draws a smaller id may commit later, so the newest id does not tell whether all are here.
            if session.scalar(select(func.count()).select_from(Setup)) != len(self._texts):
                ids = session.scalars(select(Setup.id)).all()
                self._read(session, [number for number in ids if number not in self._texts])
            return {name: sorted(values) for name, values in self._values.items()}

    def _read(self, session: Session, missing: list[int]) -> None:
        query = select(Setup.id, Setup.facts)
        if len(missing) <= MANY:
            query = query.where(Setup.id.in_(missing))
        for number, facts in session.execute(query):
            if number not in self._texts:
                # Few different texts in many set-ups: one copy of each is kept.
                texts = tuple(sys.intern(text) for text in texts_of(facts))
                self._fields[number] = tuple(sys.intern(name) for name in facts["fields"])
                self._texts[number] = texts
                for name, values in self._values.items():
                    values.add(texts[PLACE[COLUMN_OF.get(name, name)]])
        if len(missing) > MANY:
            # They stay as long as the process: no later collection need look through them and all that was imported.
            gc.collect()
            gc.freeze()


_CACHES: WeakKeyDictionary[Database, SetupCache] = WeakKeyDictionary()
_MAKING = threading.Lock()


def setups_of(database: Database) -> SetupCache:
    """The set-ups of an open database."""
    with _MAKING:
        return _CACHES.setdefault(database, SetupCache())
