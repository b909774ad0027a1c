"""Up to which id the changes are final, so that a stream of them can be resumed by the last id seen."""

from __future__ import annotations

import threading

from sqlalchemy import func, select, text

from server.store.database import Database
from server.store.models import Change

_WRITERS = text(
    "SELECT virtualtransaction FROM pg_locks WHERE locktype = 'relation' AND mode = 'RowExclusiveLock' AND granted"
    " AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
    f" AND relation = CAST('{Change.__tablename__}' AS regclass)"
)
"""The transactions that have written changes, or are about to, and are not over (PostgreSQL, Explicit Locking)."""


class Settling:
    """Knows the id up to which no change can appear any more; for any thread.

    SQLite has one writer at a time, so ids appear in order. PostgreSQL draws an id when a row is inserted and shows the
    row when its transaction commits, so a smaller id may appear after a larger one. But a transaction holds its lock on
    the table from before it draws an id until it is over. So the rule is: see the newest id N, then list the
    transactions that hold that lock; once each of them is over, whoever drew an id up to N has committed or rolled
    back. Later transactions draw larger ids and are not waited for.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = threading.Lock()
        self._settled = 0
        self._newest = 0
        self._awaited: set[str] = set()

    def settled(self) -> int:
        """Look once, and return the id up to which changes are final now; a later transaction sees them all."""
        with self._lock:
            if self._newest == self._settled:
                self._newest = self._read_newest()
                if self._newest == self._settled:
                    return self._settled
                self._awaited = self._writers()
            else:
                self._awaited &= self._writers()
            if not self._awaited:
                self._settled = self._newest
            return self._settled

    def _read_newest(self) -> int:
        with self._database.reading() as session:
            return session.scalar(select(func.max(Change.id))) or 0

    def _writers(self) -> set[str]:
        if self._database.engine.dialect.name != "postgresql":
            return set()
        with self._database.reading() as session:
            return set(session.scalars(_WRITERS))
