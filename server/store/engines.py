"""Engines for SQLite and PostgreSQL whose transactions behave alike.

A reading transaction sees one state of the database however many queries it makes; times come back in UTC.
"""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path
from typing import Any

import psycopg
from psycopg.abc import Buffer
from psycopg.types.string import StrDumper
from sqlalchemy import URL, Connection, Engine, create_engine, event
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from server.store.errors import DatabaseError

BUSY_S = 30.0
"""How long a statement waits for SQLite's write lock, and a migration for PostgreSQL's locks."""
CONNECT_S = 10
POOL = 16
"""The most connections to PostgreSQL that a process opens, as it needs them."""
IDLE_S = 20.0
"""How long PostgreSQL lets a transaction do nothing before it ends the session."""
FORMS = "write sqlite:///FILE or postgresql://USER:PASSWORD@HOST/NAME"


def make_engine(url: str) -> Engine:
    """An engine for `url`; an SQLite file's folder is made. Raise DatabaseError when the URL is none of ours."""
    parsed = _parse(url)
    return _sqlite_engine(parsed) if parsed.get_backend_name() == "sqlite" else _postgresql_engine(parsed)


def reading_engine(engine: Engine) -> Engine:
    """The engine for transactions that only read.

    SQLite's write-ahead log gives each a snapshot as it is; PostgreSQL does so when asked, and then never aborts it.
    """
    if engine.dialect.name == "sqlite":
        return engine
    return engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)


def writing_engine(engine: Engine) -> Engine:
    """The engine for transactions that write.

    On SQLite they take the write lock at once, since it refuses (without waiting) to turn a reading transaction into a
    writing one when another process has written in between. On PostgreSQL they lock the rows that they ask for.
    """
    return engine.execution_options(immediate=True)


def _parse(url: str) -> URL:
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError) as error:
        quoted = "This" if "@" in url else repr(url)  # It may hold a password.
        raise DatabaseError(f"{quoted} is no database URL: {FORMS}.") from error
    backend = {"postgres": "postgresql"}.get(parsed.get_backend_name(), parsed.get_backend_name())
    if backend not in ("sqlite", "postgresql"):
        raise DatabaseError(f"RayFarm keeps its data in SQLite or PostgreSQL, not in {backend}: {FORMS}.")
    return parsed.set(drivername="sqlite" if backend == "sqlite" else "postgresql+psycopg")


def _postgresql_engine(url: URL) -> Engine:
    defaults = {"connect_timeout": CONNECT_S, "application_name": "rayfarm"}
    unsaid = {name: value for name, value in defaults.items() if name not in url.query}
    # A server that was restarted leaves dead connections in the pool: each is tried before it is handed out.
    # Connections beyond a pool are opened and closed for each request: a burst waits for one of these instead.
    engine = create_engine(url, connect_args=unsaid, pool_pre_ping=True, pool_size=POOL, max_overflow=0)
    event.listen(engine, "connect", _prepare_postgresql)
    return engine


class _TextDumper(StrDumper):
    """Text as PostgreSQL can hold it: a phone's log may contain NUL, and SQLite keeps that."""

    def dump(self, obj: str) -> Buffer | None:
        return super().dump(obj.replace("\0", "\N{REPLACEMENT CHARACTER}"))


def _prepare_postgresql(connection: psycopg.Connection[Any], _record: Any) -> None:
    connection.adapters.register_dumper(str, _TextDumper)
    connection.execute("SET TIME ZONE 'UTC'")
    # A process that is stopped inside a transaction must not keep its locks: the others take its work over.
    connection.execute(f"SET idle_in_transaction_session_timeout = '{IDLE_S:.0f}s'")
    connection.commit()


def _sqlite_engine(url: URL) -> Engine:
    if url.database:
        try:
            Path(url.database).expanduser().parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DatabaseError(f"The folder of the database {url} cannot be made: {error.strerror}.") from error
    engine = create_engine(url, connect_args={"timeout": BUSY_S})
    event.listen(engine, "connect", _prepare_sqlite)
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def _prepare_sqlite(connection: sqlite3.Connection, _record: Any) -> None:
    # The driver's own transaction handling is off: `_begin_sqlite` says BEGIN itself.
    connection.isolation_level = None
    _use_wal(connection)
    for pragma in ("synchronous = NORMAL", "foreign_keys = ON"):
        connection.execute(f"PRAGMA {pragma}").close()


def _use_wal(connection: sqlite3.Connection) -> None:
    # SQLite does not apply its busy timeout to a change of the journal mode, and two processes may start at once.
    deadline = time.monotonic() + BUSY_S
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL").close()
            return
        except sqlite3.OperationalError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)


def _begin_sqlite(connection: Connection) -> None:
    immediate = connection.get_execution_options().get("immediate", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")
