"""The tests' own PostgreSQL server leaves nothing behind, however the test run ends."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psycopg
import pytest
from postgres import PostgresCluster, find_binaries

TESTS = Path(__file__).parents[1]
RUN = """
import sys
from postgres import find_binaries, running_cluster
with running_cluster(find_binaries()) as cluster:
    print(cluster.url(), flush=True)
    sys.stdin.read()
"""


def test_a_database_is_dropped_with_its_likes(postgres_cluster: PostgresCluster) -> None:
    with postgres_cluster.database() as url:
        name = url.rsplit("/", 1)[1]
        with psycopg.connect(url, autocommit=True) as connection:
            connection.execute(f'CREATE DATABASE "{name}_more"'.encode())
    with psycopg.connect(postgres_cluster.url()) as connection:
        left = connection.execute("SELECT datname FROM pg_database WHERE starts_with(datname, %s)", [name]).fetchall()
    assert left == []


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.skipif(find_binaries() is None, reason="PostgreSQL's server programs are not installed")
def test_the_server_ends_with_the_test_run(how: signal.Signals) -> None:
    command = [sys.executable, "-c", RUN]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=TESTS
    ) as run:
        assert run.stdout is not None
        url = run.stdout.readline().decode().strip()
        with psycopg.connect(url) as connection:
            ((data,),) = connection.execute("SHOW data_directory").fetchall()
        run.send_signal(how)
        run.communicate()
    _wait_for(lambda: not Path(data).parent.exists())
    with pytest.raises(psycopg.OperationalError, match="refused"):
        psycopg.connect(url)


def _wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"nothing happened in {seconds} s"
        time.sleep(0.05)
