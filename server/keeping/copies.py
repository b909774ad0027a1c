"""A copy of a database in one file, and back, by the database's own means: SQLite's online backup, pg_dump, pg_restore.

Both copy one state of a database that is in use.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

from sqlalchemy import URL

from server.keeping.errors import KeepingError
from server.store.errors import shown


def save(url: URL, file: Path) -> None:
    """Copy a database into a new file; raise KeepingError where that fails."""
    if url.get_backend_name() == "sqlite":
        _copy_sqlite(_file_of(url), file)
        with closing(sqlite3.connect(file)) as copy:
            # It asks for a write-ahead log, as what it is a copy of has one: the file alone must do.
            copy.execute("PRAGMA journal_mode = DELETE")
    else:
        _run("pg_dump", url, "--format=custom", "--no-owner", "--no-privileges", f"--file={file}")


def load(url: URL, file: Path) -> None:
    """Make a database what a copy of it is; raise KeepingError where that fails."""
    if url.get_backend_name() == "sqlite":
        _copy_sqlite(file, _file_of(url))
    else:
        # All or nothing: a restore that fails leaves the database as it was.
        options = ("--clean", "--if-exists", "--no-owner", "--no-privileges", "--single-transaction")
        _run("pg_restore", url, *options, f"--dbname={url.database}", str(file))


def _copy_sqlite(source: Path, target: Path) -> None:
    try:
        with closing(sqlite3.connect(source)) as read, closing(sqlite3.connect(target, timeout=30)) as written:
            read.backup(written)
            [(said,)] = written.execute("PRAGMA integrity_check(1)").fetchall()
    except sqlite3.Error as error:
        raise KeepingError(f"{source} cannot be copied to {target} ({error}): check both.") from error
    if said != "ok":
        raise KeepingError(f"The database {source} is damaged ({said}): use an earlier backup.")


def _file_of(url: URL) -> Path:
    if not url.database or url.database == ":memory:":
        raise KeepingError("A database in memory cannot be backed up: set RAYFARM_DATABASE_URL to a file's.")
    return Path(url.database).expanduser()


def _run(program: str, url: URL, *options: str) -> None:
    """Run one of PostgreSQL's programs; the password goes by the environment, which other users cannot read."""
    told: dict[str, object] = {
        "PGHOST": url.host,
        "PGPORT": url.port,
        "PGUSER": url.username,
        "PGPASSWORD": url.password,
    }
    told |= {"PGDATABASE": url.database, **{f"PG{name.upper()}": value for name, value in url.query.items()}}
    environment = os.environ | {name: str(value) for name, value in told.items() if value is not None}
    command = [str(_find(program)), "--no-password", *options]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        said = next((line for line in reversed(done.stderr.splitlines()) if "error" in line), done.stderr.strip())
        raise KeepingError(f"{program} fails on {shown(url)}: {said.removeprefix(f'{program}: ')[:300].rstrip('.')}.")


def _find(program: str) -> Path:
    """The newest there is: an older one refuses a newer server. Debian keeps them apart from PATH."""
    folders = [*Path("/usr/lib/postgresql").glob("*/bin"), *Path("/usr").glob("pgsql-*/bin")]
    versions = {path: int("".join(filter(str.isdigit, path.parent.name)) or 0) for path in folders}
    found = [folder / program for folder in sorted(versions, key=versions.__getitem__) if (folder / program).exists()]
    on_path = shutil.which(program)
    if found or on_path:
        return found[-1] if found else Path(str(on_path))
    raise KeepingError(f"{program} is not installed: it is in PostgreSQL's client (apt install postgresql-client).")
