"""The database as it is: opened without making or changing anything."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Engine, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError

from server.doctor.finding import Said
from server.settings import settings
from server.store.engines import make_engine
from server.store.errors import DatabaseError, explain


@contextmanager
def opened() -> Iterator[tuple[Engine | None, Said]]:
    """The database, or None and what to say of that."""
    file = _file(settings().database_url)
    if file is not None and not file.exists():
        yield None, ("good", f"There is no {file} yet: the first start makes it.")
        return
    try:
        engine = make_engine(settings().database_url)
    except DatabaseError as error:
        yield None, ("missing", str(error))
        return
    try:
        said = _refusal(engine)
        yield (engine, ("good", "")) if said is None else (None, ("missing", said))
    finally:
        engine.dispose()


def _file(url: str) -> Path | None:
    """SQLite's file; None for another database, and for what is no URL."""
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        return None
    is_sqlite = parsed.get_backend_name() == "sqlite"
    return Path(parsed.database).expanduser() if is_sqlite and parsed.database else None


def _refusal(engine: Engine) -> str | None:
    try:
        engine.connect().close()
    except DBAPIError as error:
        return str(explain(engine.url, error))
    return None
