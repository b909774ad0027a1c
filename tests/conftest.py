"""The databases that tests run on: SQLite, and a PostgreSQL server of the test run's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext

import pytest
from postgres import PostgresCluster, find_binaries, running_cluster

from server.queue.durable import Durable
from server.store.database import Database


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--minutes`: how long `make test-soak` takes."""
    parser.addoption("--minutes", type=float, default=60.0, help="how long the soak test puts a farm under jobs")


FreshDatabase = Callable[..., AbstractContextManager[str]]


@pytest.fixture(scope="session", autouse=True)
def _no_phones() -> Iterator[None]:
    """No test but those of phones speaks to an adb server, and those to one of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_PHONES", "off")
        yield


@pytest.fixture(scope="session", autouse=True)
def _buffered() -> Iterator[None]:
    """Programs write to pipes as everywhere: where this is set, one that does not flush is not noticed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("PYTHONUNBUFFERED", raising=False)
        yield


@pytest.fixture(scope="session")
def postgres_cluster() -> Iterator[PostgresCluster]:
    """A PostgreSQL server; `with postgres_cluster.database() as url:` gives a fresh, empty database."""
    binaries = find_binaries()
    if binaries is None:
        pytest.skip("PostgreSQL's server programs are not installed: apt install postgresql")
    with running_cluster(binaries) as cluster:
        yield cluster


@pytest.fixture(scope="session")
def fresh_database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> FreshDatabase:
    """`with fresh_database(kind) as url:` gives a fresh database of a kind, as many as wanted.

    A PostgreSQL one has the tables already (a copy takes 30 ms) unless it is asked to be `empty`; it is dropped with
    the block.
    """

    def fresh(kind: str, empty: bool = False) -> AbstractContextManager[str]:
        if kind == "sqlite":
            return nullcontext(f"sqlite:///{tmp_path_factory.mktemp('database') / 'test.sqlite'}")
        cluster: PostgresCluster = request.getfixturevalue("postgres_cluster")
        return cluster.database(None if empty else _make_tables)

    return fresh


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def database_kind(request: pytest.FixtureRequest) -> str:
    """The kinds of database that a test runs on, one after the other."""
    return str(request.param)


@pytest.fixture
def database_url(database_kind: str, fresh_database: FreshDatabase) -> Iterator[str]:
    """The URL of a fresh database for one test, on each kind."""
    with fresh_database(database_kind) as url:
        yield url


def _make_tables(url: str) -> None:
    database = Database(url)
    Durable(database).close()
    database.close()
