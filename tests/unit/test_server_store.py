"""The store: migrations match the models, times keep their zone, NaN becomes null."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext

from server.store.database import Database, DatabaseError
from server.store.models import Base, Study
from server.store.records import without_nan


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = Database(f"sqlite:///{tmp_path / 'folder' / 'x.sqlite'}")
    yield opened
    opened.close()


def test_the_migrations_make_what_the_models_say(database: Database) -> None:
    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []


def test_times_come_back_in_utc(database: Database) -> None:
    at = datetime(2026, 1, 2, 3, 4, 5, 678, tzinfo=UTC)
    with database.writing() as session:
        session.add(Study(name="x", request={}, refused=[], created_at=at))
    with database.reading() as session:
        assert session.get_one(Study, 1).created_at == at


def test_a_failed_transaction_leaves_nothing(database: Database) -> None:
    def write_and_fail() -> None:
        with database.writing() as session:
            session.add(Study(name="x", request={}, refused=[]))
            session.flush()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_and_fail()
    with database.reading() as session:
        assert session.get(Study, 1) is None


def test_many_writers_wait_for_each_other(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'x.sqlite'}"

    def write() -> None:
        database = Database(url)
        for _ in range(20):
            with database.writing() as session:
                session.add(Study(name=str(session.query(Study).count()), request={}, refused=[]))
        database.close()

    threads = [threading.Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    database = Database(url)
    with database.reading() as session:
        names = [study.name for study in session.query(Study).order_by(Study.id)]
    database.close()
    assert names == [str(number) for number in range(80)]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("nonsense", "no database URL"),
        ("nosuch://x", "driver"),
        ("sqlite:////proc/nothing/x.sqlite", "cannot be made"),
        ("sqlite:////proc/x.sqlite", "cannot be opened"),
    ],
)
def test_a_database_that_cannot_be_opened_says_why(url: str, words: str) -> None:
    with pytest.raises(DatabaseError, match=words):
        Database(url)


def test_what_json_cannot_hold_becomes_null() -> None:
    value = {"a": float("nan"), "b": [1.5, float("inf"), {"c": -float("inf")}], "d": "nan", "e": 0}
    assert without_nan(value) == {"a": None, "b": [1.5, None, {"c": None}], "d": "nan", "e": 0}
