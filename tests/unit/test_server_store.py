"""The store, on SQLite and on PostgreSQL: transactions, times, migrations; NaN becomes null."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import UTC, datetime
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from postgres import PostgresCluster
from sqlalchemy import select, text

from server.store.database import Database
from server.store.models import Base, Study
from server.store.records import without_nan


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    opened = Database(database_url)
    yield opened
    opened.close()


def add_study(database: Database, name: str = "x") -> None:
    with database.writing() as session:
        session.add(Study(name=name, request={}, refused=[]))


def names(database: Database) -> list[str]:
    with database.reading() as session:
        return list(session.scalars(select(Study.name).order_by(Study.id)))


def test_the_migrations_make_what_the_models_say(database: Database) -> None:
    with database.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []


def test_a_missing_folder_is_made(tmp_path: Path) -> None:
    Database(f"sqlite:///{tmp_path / 'folder' / 'x.sqlite'}").close()
    assert (tmp_path / "folder" / "x.sqlite").exists()


def test_times_come_back_in_utc(database: Database) -> None:
    at = datetime(2026, 1, 2, 3, 4, 5, 678, tzinfo=UTC)
    with database.writing() as session:
        session.add(Study(name="x", request={}, refused=[], created_at=at))
    with database.reading() as session:
        assert session.get_one(Study, 1).created_at.isoformat() == "2026-01-02T03:04:05.000678+00:00"


def test_a_failed_transaction_leaves_nothing(database: Database) -> None:
    def write_and_fail() -> None:
        with database.writing() as session:
            session.add(Study(name="x", request={}, refused=[]))
            session.flush()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_and_fail()
    assert names(database) == []


def test_any_text_can_be_kept_and_asked_for(database: Database) -> None:
    hostile = "<b>'; DROP TABLE studies; --\0\r\n\x1b[31m\u202e\U0001f4a5"
    body = {"text": hostile, "lone": "\ud800"}
    with database.writing() as session:
        session.add(Study(name=hostile, request=body, refused=[hostile]))
    with database.reading() as session:
        study = session.scalars(select(Study).where(Study.name == hostile)).one()
        assert study.name in (hostile, hostile.replace("\0", "\ufffd"))
        assert (study.request, study.refused) == (body, [hostile])


def test_a_reader_sees_one_state(database: Database) -> None:
    add_study(database, "before")
    with database.reading() as session:
        first = session.query(Study).count()
        add_study(database, "between")
        assert session.query(Study).count() == first
    assert names(database) == ["before", "between"]


def test_many_writers_wait_for_each_other(database_url: str) -> None:
    counter = Database(database_url)
    add_study(counter, "0")

    def write() -> None:
        database = Database(database_url)
        for _ in range(20):
            with database.writing() as session:
                study = session.get_one(Study, 1, with_for_update=True)
                study.name = str(int(study.name) + 1)
        database.close()

    threads = [threading.Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = names(counter)
    counter.close()
    assert found == ["80"]


def test_two_databases_are_apart(
    database: Database, database_kind: str, fresh_database: Callable[[str], AbstractContextManager[str]]
) -> None:
    with fresh_database(database_kind) as url:
        other = Database(url)
        add_study(other)
        other.close()
    assert names(database) == []


def test_a_lost_connection_is_replaced(postgres_cluster: PostgresCluster) -> None:
    with postgres_cluster.database() as url:
        database = Database(url)
        database.check()
        other = Database(url)
        with other.engine.connect() as connection:
            end = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE datname = current_database()"
            assert connection.scalar(text(f"{end} AND pid != pg_backend_pid()")) == 1
        database.check()
        database.close()
        other.close()


def test_what_json_cannot_hold_becomes_null() -> None:
    value = {"a": float("nan"), "b": [1.5, float("inf"), {"c": -float("inf")}], "d": "nan", "e": 0}
    assert without_nan(value) == {"a": None, "b": [1.5, None, {"c": None}], "d": "nan", "e": 0}
