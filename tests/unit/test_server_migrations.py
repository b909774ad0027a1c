"""Migrations on SQLite and on PostgreSQL: old data stays, several processes start at once."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import psycopg
import pytest
from alembic import command
from alembic.config import Config
from postgres import PostgresCluster
from sqlalchemy import Connection, select, text

from server.store import database as module
from server.store.database import MIGRATIONS, Database, DatabaseError
from server.store.engines import make_engine, writing_engine
from server.store.models import Change, Job, Result, Slice, Study
from server.store.setups import facts_of, require_setup

ROOT = Path(__file__).parents[2]
OPEN = "import sys; from server.store.database import Database; Database(sys.argv[1]).close()"
AT = "2026-01-02 03:04:05.000000+00:00"
FIRST = [
    f"INSERT INTO studies (name, request, refused, created_at) VALUES ('old', '{{}}', '[]', '{AT}')",
    "INSERT INTO jobs (study_id, scene, label, request, state, created_at)"
    f" VALUES (1, 'forest', 'bvh-stack', '{{\"frames\": 3}}', 'done', '{AT}')",
    "INSERT INTO slices (job_id, round, state, attempts, measurement) VALUES (1, 0, 'done', 1, '{\"round\": 0}')",
    f"INSERT INTO changes (job_id, state, at) VALUES (1, 'done', '{AT}')",
    "INSERT INTO results (job_id, recorded_at, scene, device, traversal, method, layout, intersector, box, nodes,"
    f" precision, \"offset\", builder, document) VALUES (1, '{AT}', 'forest', 'llvmpipe',"
    " 'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h', 'i', '{\"scene\": \"forest\"}')",
]
"""A study as the first release kept it."""


@pytest.fixture
def empty_url(database_kind: str, fresh_database: Callable[..., AbstractContextManager[str]]) -> Iterator[str]:
    with fresh_database(database_kind, empty=True) as url:
        yield url


def migrate(connection: Connection, revision: str) -> None:
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["connection"] = connection
    command.upgrade(config, revision)


def test_what_the_first_release_kept_is_kept(empty_url: str) -> None:
    engine = make_engine(empty_url)
    with writing_engine(engine).begin() as connection:
        migrate(connection, "0001")
        for statement in FIRST:
            connection.exec_driver_sql(statement)
    engine.dispose()
    database = Database(empty_url)
    with database.reading() as session:
        for table in (Study, Job, Slice, Change, Result):
            assert len(session.scalars(select(table)).all()) == 1
        job = session.scalars(select(Job)).one()
        assert (job.request, job.slices[0].measurement) == ({"frames": 3}, {"round": 0})
        assert (job.slices[0].started_at, job.slices[0].ended_at) == (None, None)
        assert job.created_at.isoformat() == "2026-01-02T03:04:05+00:00"
        assert job.result is not None
        assert job.result.document == {"scene": "forest", "fetch": "storage"}
        assert job.result.fetch == "storage"
        assert job.result.setup_id == require_setup(session, facts_of(job.result.document))
    database.close()


def test_processes_that_start_at_once_make_the_tables_once(empty_url: str) -> None:
    command = [sys.executable, "-c", OPEN, empty_url]
    children = [subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) for _ in range(4)]
    said = [child.communicate(timeout=60)[1] for child in children]
    assert [child.returncode for child in children] == [0] * 4, said
    database = Database(empty_url)
    with database.reading() as session:
        assert session.scalar(text("SELECT count(*) FROM alembic_version")) == 1
    database.close()


def test_a_database_of_a_later_release_is_refused(database_url: str) -> None:
    database = Database(database_url)
    with database.writing() as session:
        session.execute(text("UPDATE alembic_version SET version_num = 'later'"))
    database.close()
    with pytest.raises(DatabaseError, match="later RayFarm: update this one"):
        Database(database_url)


def test_a_migration_does_not_wait_for_ever(postgres_cluster: PostgresCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BUSY_S", 0.05)
    with postgres_cluster.database() as url, psycopg.connect(url) as holder:
        holder.execute("SELECT pg_advisory_xact_lock(%s)", [module._MIGRATION_LOCK])
        with pytest.raises(DatabaseError, match=r"Another process holds .*lock timeout\)"):
            Database(url)
