"""Why a database cannot be opened, in one sentence that says what to do."""

from __future__ import annotations

import re

from sqlalchemy import URL
from sqlalchemy.exc import DBAPIError, InterfaceError, InternalError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

# libpq gives no SQLSTATE for a connection that fails, so its words decide; others fall back to the plain sentence.
_REFUSED = re.compile(
    r"password authentication failed|no password supplied|role .* does not exist|no pg_hba.conf entry"
)
_MISSING = re.compile(r"database .* does not exist")
_SILENT = re.compile(
    r"connection refused|no such file|timeout expired|failed to resolve|unreachable|no route to host|invalid port"
    r"|closed the connection",
    re.IGNORECASE,
)
_HELD = re.compile(r"lock timeout|database is locked")
_PREFIX = re.compile(r"^connection (failed|is bad): |connection to server .*? failed: |(FATAL|ERROR): +")


AWAY = (OperationalError, InterfaceError, InternalError, PoolTimeoutError)
"""What SQLAlchemy raises when a database is away, full, locked or shutting down: the same may be asked again."""
_FULL = re.compile(r"disk is full|No space left on device|disk full", re.IGNORECASE)


class DatabaseError(ValueError):
    """A database that cannot be opened; the message is one sentence that says what to do."""


def shown(url: URL) -> str:
    """A database's URL without its password and driver."""
    plain = url.set(drivername=url.get_backend_name()).difference_update_query(["password"])
    return plain.render_as_string(hide_password=True)


def shortly(error: Exception) -> str:
    """The first line of what the database's driver said."""
    said = str(getattr(error, "orig", None) or error).strip()
    return _PREFIX.sub("", said.splitlines()[0]).rstrip(".") if said else type(error).__name__


def sentence(error: Exception) -> str:
    """What to tell who asked, when one of AWAY came: what to do, and nothing of the database's own words."""
    said = shortly(error)
    if _FULL.search(said):
        return "The disk of the database is full, and nothing was changed: free space there, then send this again."
    if _HELD.search(said):
        return "The database is busy, and nothing was changed: send this again."
    return "The database does not answer: send this again in a moment."


def explain(url: URL, error: DBAPIError) -> DatabaseError:
    """The error to raise when `url` could not be opened."""
    said, reason = str(error.orig).strip().splitlines()[0], shortly(error)
    if _HELD.search(said):
        return DatabaseError(f"Another process holds the database {shown(url)} ({reason}): let it end, then try again.")
    if url.get_backend_name() == "postgresql":
        if _REFUSED.search(said):
            return DatabaseError(f"The server of {shown(url)} refuses the login ({reason}): correct user and password.")
        if _MISSING.search(said):
            create = f"create it (createdb {url.database})"
            return DatabaseError(f"The server of {shown(url)} has no such database: {create} or name another.")
        if _SILENT.search(said):
            return DatabaseError(f"No server answers at {shown(url)} ({reason}): start PostgreSQL or correct the URL.")
    return DatabaseError(f"The database {shown(url)} cannot be opened: {reason}.")
