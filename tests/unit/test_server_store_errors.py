"""A database that cannot be opened says why in one sentence, and keeps its password to itself."""

from __future__ import annotations

import re
from pathlib import Path

import psycopg
import pytest
from postgres import PostgresCluster

from server.store.database import Database, DatabaseError


def refusal(url: str) -> str:
    with pytest.raises(DatabaseError) as caught:
        Database(url)
    said = str(caught.value)
    assert said.endswith(".")
    assert "\n" not in said
    return said


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("nonsense", "'nonsense' is no database URL: write sqlite:///FILE or postgresql://"),
        ("mysql://x", "SQLite or PostgreSQL, not in mysql"),
        ("sqlite:////proc/nothing/x.sqlite", "cannot be made"),
        ("sqlite:////proc/x.sqlite", "cannot be opened"),
        ("postgresql://me:secret@127.0.0.1:1/x", "No server answers at postgresql://me:***@127.0.0.1:1/x"),
        ("postgres://me:secret@127.0.0.1:1/x", "No server answers at postgresql://me:***@127.0.0.1:1/x"),
        ("postgresql+psycopg2://me:secret@127.0.0.1:1/x", "No server answers at postgresql://me:***@127.0.0.1:1/x"),
        ("postgresql://name.invalid/x?user=me&password=secret", "No server answers at postgresql://name.invalid/x"),
        ("postgresql://me:secret@127.0.0.1:port/x", "This is no database URL"),
        ("postgresql://me:secret@127.0.0.1:1/x?sslmod=require", 'option "sslmod"'),
    ],
)
def test_a_wrong_url_is_refused(url: str, words: str) -> None:
    said = refusal(url)
    assert words in said
    assert "secret" not in said


def test_a_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("Not a database. " * 100)
    assert "file is not a database" in refusal(f"sqlite:///{tmp_path / 'notes.txt'}")


def test_a_wrong_password_is_refused(postgres_cluster: PostgresCluster) -> None:
    url = postgres_cluster.url()
    said = refusal(url.replace(postgres_cluster.password, "guess"))
    assert "refuses the login" in said
    assert "guess" not in said
    assert "refuses the login" in refusal(url.replace(f":{postgres_cluster.password}", ""))
    assert "refuses the login" in refusal(url.replace("//rayfarm:", "//stranger:"))


def test_a_missing_database_is_refused(postgres_cluster: PostgresCluster) -> None:
    assert "has no such database: create it (createdb atlantis)" in refusal(postgres_cluster.url("atlantis"))


def test_a_user_without_rights_is_refused(postgres_cluster: PostgresCluster) -> None:
    with postgres_cluster.database() as url:
        with psycopg.connect(url, autocommit=True) as connection:
            connection.execute("CREATE ROLE guest LOGIN PASSWORD 'guest'")
            connection.execute("REVOKE CREATE ON SCHEMA public FROM PUBLIC")  # The default since PostgreSQL 15.
        said = refusal(re.sub("//.*@", "//guest:guest@", url))
    assert "cannot be opened: permission denied for schema public" in said
