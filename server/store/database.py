"""Opening the database: engine, transactions, migrations."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from sqlalchemy import URL, Connection, Engine, create_engine, event, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError, OperationalError
from sqlalchemy.orm import Session

MIGRATIONS = Path(__file__).resolve().parent.parent / "migrations"
BUSY_S = 30.0
_UPGRADING = threading.Lock()  # Alembic keeps the migration's context in module globals.


class DatabaseError(ValueError):
    """A database that cannot be opened; the message is one sentence that says what to do."""


class Database:
    """One database; a process opens it once and closes it with `close`."""

    def __init__(self, url: str) -> None:
        """Open `url`, creating a missing SQLite file and its folder, and bring the tables up to date."""
        try:
            self.engine = _engine(url)
        except OSError as error:
            raise DatabaseError(f"The folder of the database {url!r} cannot be made: {error.strerror}.") from error
        # Readers need no lock in WAL mode; a writer takes its lock at once, since SQLite refuses (without waiting)
        # to turn a reading transaction into a writing one when another process has written in between.
        self._writer = self.engine.execution_options(immediate=True)
        shown = self.engine.url.render_as_string(hide_password=True)
        try:
            upgrade(self.engine)
        except OperationalError as error:
            self.close()
            reason = str(error.orig).strip().splitlines()[0].rstrip(".")
            raise DatabaseError(f"The database {shown} cannot be opened: {reason}.") from error

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """A session that only reads."""
        with Session(self.engine) as session:
            yield session

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """A session whose changes are committed at the end, all or none."""
        with Session(self._writer, expire_on_commit=False) as session, session.begin():
            yield session

    def check(self) -> None:
        """Ask the database one question; raise what SQLAlchemy raises when it does not answer."""
        with self.reading() as session:
            session.execute(text("SELECT 1"))

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


def upgrade(engine: Engine) -> None:
    """Run the migrations that the database has not seen; two processes may do this at once."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    with _UPGRADING, engine.execution_options(immediate=True).begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def _engine(url: str) -> Engine:
    try:
        parsed = make_url(url)
    except ArgumentError as error:
        raise DatabaseError(f"{url!r} is no database URL: write sqlite:///FILE or postgresql://...") from error
    if parsed.get_backend_name() != "sqlite":
        return _other_engine(parsed)
    if parsed.database:
        Path(parsed.database).expanduser().parent.mkdir(parents=True, exist_ok=True)
    engine = create_engine(parsed, connect_args={"timeout": BUSY_S})
    event.listen(engine, "connect", _prepare_sqlite)
    event.listen(engine, "begin", _begin_sqlite)
    return engine


def _other_engine(url: URL) -> Engine:
    try:
        return create_engine(url)
    except (ModuleNotFoundError, NoSuchModuleError) as error:
        raise DatabaseError(f"No driver is installed for {url.drivername} databases: {error}.") from error


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
