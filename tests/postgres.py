"""A private, throw-away PostgreSQL server for tests, with a fresh database for each that asks."""

from __future__ import annotations

import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import psycopg
from postgres_keeper import START, STOP, USER
from psycopg import sql

KEEPER = Path(__file__).with_name("postgres_keeper.py")
START_S = 60.0
STARTS = 3
"""Another process may take the free port between its choice and its use."""


class PostgresError(RuntimeError):
    """A server that did not start; the message carries its log."""


@dataclass
class PostgresCluster:
    """A running server. URLs work in psycopg, SQLAlchemy and libpq's programs, from any process of this host."""

    port: int
    password: str
    keeper: subprocess.Popen[bytes] | None = None
    _templates: dict[str, str] = field(default_factory=dict)

    def url(self, database: str = "postgres") -> str:
        """The URL of one of its databases, as a superuser."""
        return f"postgresql://{USER}:{self.password}@127.0.0.1:{self.port}/{database}"

    def create(self, template: str = "template1") -> str:
        """Make a database with what is in `template`; return its name."""
        name = f"rayfarm_{secrets.token_hex(6)}"
        self._execute(sql.SQL("CREATE DATABASE {} TEMPLATE {}").format(sql.Identifier(name), sql.Identifier(template)))
        return name

    def drop(self, database: str) -> None:
        """Drop a database, and those that were named after it, whoever is connected."""
        with psycopg.connect(self.url(), autocommit=True) as connection:
            found = connection.execute("SELECT datname FROM pg_database WHERE starts_with(datname, %s)", [database])
            for (name,) in found.fetchall():
                connection.execute(sql.SQL("DROP DATABASE {} WITH (FORCE)").format(sql.Identifier(name)))

    @contextmanager
    def database(self, prepare: Callable[[str], None] | None = None) -> Iterator[str]:
        """The URL of a fresh database, dropped with the block.

        `prepare` fills one database by its URL, once per cluster, and leaves no connection open; this is a copy of it.
        """
        name = self.create(*([] if prepare is None else [self._template(prepare)]))
        try:
            yield self.url(name)
        finally:
            self.drop(name)

    def answers(self) -> bool:
        """Whether it can be connected to."""
        try:
            psycopg.connect(self.url(), connect_timeout=2).close()
        except psycopg.OperationalError:
            return False
        return True

    def stop(self) -> None:
        """Stop the server as a crash would."""
        self._tell(STOP)
        while self.answers():
            time.sleep(0.02)

    def start(self) -> None:
        """Start it again, and wait until it answers."""
        self._tell(START)
        assert self.keeper is not None
        assert _wait_until_ready(self.keeper, self)

    def _tell(self, word: bytes) -> None:
        assert self.keeper is not None
        assert self.keeper.stdin is not None
        self.keeper.stdin.write(word)
        self.keeper.stdin.flush()

    def _template(self, prepare: Callable[[str], None]) -> str:
        key = f"{prepare.__module__}.{prepare.__qualname__}"
        if key not in self._templates:
            name = self.create()
            prepare(self.url(name))
            self._templates[key] = name
        return self._templates[key]

    def _execute(self, statement: sql.Composed) -> None:
        with psycopg.connect(self.url(), autocommit=True) as connection:
            connection.execute(statement)


def find_binaries() -> Path | None:
    """The folder of the newest PostgreSQL server programs, or None where there are none.

    Debian and Red Hat keep them apart from PATH, one folder a version.
    """
    folders = [*Path("/usr/lib/postgresql").glob("*/bin"), *Path("/usr").glob("pgsql-*/bin")]
    on_path = shutil.which("postgres")
    if on_path is not None:
        folders.insert(0, Path(on_path).resolve().parent)
    whole = [folder for folder in folders if (folder / "initdb").exists() and (folder / "postgres").exists()]
    return max(whole, key=_version, default=None)


@contextmanager
def running_cluster(binaries: Path, *settings: str, before: Sequence[str] = ()) -> Iterator[PostgresCluster]:
    """A server on a free port of 127.0.0.1, with settings (`name=value`) beside the usual ones.

    It ends with the block, and with this process however that ends. `before` are words that its command comes after;
    they must exec it.

    Raise PostgresError when it does not start.
    """
    with tempfile.TemporaryFile() as log:
        for attempt in range(1, STARTS + 1):
            cluster = PostgresCluster(_free_port(), secrets.token_hex(16))
            keeper = cluster.keeper = _start_keeper(binaries, cluster, log, settings, before)
            try:
                if _wait_until_ready(keeper, cluster):
                    yield cluster
                    return
            finally:
                _stop(keeper)
            log.seek(0)
            said = log.read().decode(errors="replace")
            if attempt == STARTS or "could not create any TCP/IP sockets" not in said:
                raise PostgresError(f"PostgreSQL did not start:\n{said[-4000:]}")


def _start_keeper(
    binaries: Path, cluster: PostgresCluster, log: IO[bytes], settings: Sequence[str], before: Sequence[str]
) -> subprocess.Popen[bytes]:
    command = [*before, sys.executable, str(KEEPER), str(binaries), str(cluster.port), *settings]
    # A session of its own: an interrupt from the keyboard is for the tests, whose fixtures still need the server.
    keeper = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=log, stderr=log, start_new_session=True)
    assert keeper.stdin is not None
    keeper.stdin.write(f"{cluster.password}\n".encode())
    keeper.stdin.flush()
    return keeper


def _wait_until_ready(keeper: subprocess.Popen[bytes], cluster: PostgresCluster) -> bool:
    deadline = time.monotonic() + START_S
    while keeper.poll() is None and time.monotonic() < deadline:
        if cluster.answers():
            return True
        time.sleep(0.05)
    return False


def _stop(keeper: subprocess.Popen[bytes]) -> None:
    assert keeper.stdin is not None
    keeper.stdin.close()
    try:
        keeper.wait(START_S)
    except subprocess.TimeoutExpired:
        keeper.kill()
        keeper.wait()


def _free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    assert isinstance(port, int)
    return port


def _version(folder: Path) -> tuple[int, ...]:
    said = subprocess.run([folder / "postgres", "--version"], capture_output=True, text=True, check=True).stdout
    return tuple(int(part) for part in said.split()[2].split(".") if part.isdigit())
