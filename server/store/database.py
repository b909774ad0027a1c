"""Opening the database: transactions, migrations."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.util import CommandError
from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from server.store.engines import BUSY_S, make_engine, reading_engine, writing_engine
from server.store.errors import DatabaseError, explain, shown

__all__ = ["Database", "DatabaseError", "upgrade"]

MIGRATIONS = Path(__file__).resolve().parent.parent / "migrations"
_UPGRADING = threading.Lock()  # Alembic keeps the migration's context in module globals.
_MIGRATION_LOCK = 0x7261_7966_6172_6D  # "rayfarm": PostgreSQL's advisory locks have numbers for names.


class Database:
    """One database; a process opens it once and closes it with `close`."""

    def __init__(self, url: str) -> None:
        """Open `url`, creating a missing SQLite file and its folder, and bring the tables up to date."""
        self.engine = make_engine(url)
        self._reader = reading_engine(self.engine)
        self._writer = writing_engine(self.engine)
        try:
            upgrade(self.engine)
        except DBAPIError as error:
            self.close()
            raise explain(self.engine.url, error) from error
        except CommandError as error:
            self.close()
            newer = f"The database {shown(self.engine.url)} was written by a later RayFarm: update this one"
            raise DatabaseError(f"{newer} ({error}).") from error

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """A session that only reads, one state of the database."""
        with Session(self._reader) as session:
            yield session

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """A session whose changes are committed at the end, all or none.

        What it decides on it reads `with_for_update`: only SQLite has one writer at a time.
        """
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
    with _UPGRADING, writing_engine(engine).begin() as connection:
        _wait_for_turn(connection)
        config.attributes["connection"] = connection
        command.upgrade(config, "head")


def _wait_for_turn(connection: Connection) -> None:
    # SQLite's transaction has the only write lock by now; both locks go with the transaction.
    if connection.dialect.name == "postgresql":
        connection.execute(text(f"SET LOCAL lock_timeout = '{BUSY_S * 1000:.0f}ms'"))
        connection.execute(text("SELECT pg_advisory_xact_lock(:number)"), {"number": _MIGRATION_LOCK})
