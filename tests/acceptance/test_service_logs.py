"""What `rayfarm serve` writes on standard error: JSON lines from server and worker, with ids and without secrets."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from service_fakes import wait_for

from server.access import tokens
from server.service import address, listen
from server.store.database import Database

JOB = {"scene": "cornell-box", "size": 16, "frames": 1, "check": "none", "method": "compute"}


def test_a_job_can_be_followed_through_the_log_and_no_token_is_in_it(
    database_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAYFARM_DATABASE_URL", database_url)
    monkeypatch.setenv("RAYFARM_BLOBS", str(tmp_path / "blobs"))
    monkeypatch.setenv("RAYFARM_REQUIRE_TOKENS", "true")
    database = Database(database_url)
    with database.writing() as session:
        good = tokens.create(session, "tester", ["submit"], timedelta(days=1))[1]
    database.close()
    bad = good[:-5] + "wrong"
    sock = listen("127.0.0.1", 0)
    base, port = address(sock), sock.getsockname()[1]
    sock.close()
    command = [sys.executable, "-m", "server.cli.app", "serve", "--port", str(port)]
    with (
        (tmp_path / "log").open("wb") as log,
        subprocess.Popen(command, stderr=log, stdout=subprocess.DEVNULL) as serve,
    ):
        try:
            job = follow_a_job(base, good, bad)
        finally:
            serve.send_signal(signal.SIGTERM)
        assert serve.wait(30) == 0
    text = (tmp_path / "log").read_text()
    said: list[dict[str, Any]] = [json.loads(line) for line in text.splitlines()]
    assert all({"time", "level", "logger", "what"} <= line.keys() for line in said)
    for secret in (good, bad, good.partition(".")[2], bad.partition(".")[2]):
        assert secret not in text
    ours = [line["what"].partition(":")[0] for line in said if line.get("job") == job]
    assert ours == ["jobs accepted", "slice taken", "slice recorded"]
    taken = next(line for line in said if line["what"].startswith("slice taken"))
    assert {"slice", "device", "attempt", "round"} <= taken.keys()
    whats = [line["what"] for line in said]
    for what in ("serving", "worker started", "a token was refused", "worker ended", "ending"):
        assert what in whats


def follow_a_job(base: str, good: str, bad: str) -> int:
    """Send a wrong token and a job, and see the job done; return its id."""
    with httpx.Client(base_url=f"{base}/api/v1", timeout=30, trust_env=False) as client:
        wait_for(lambda: answers(client), 60)
        assert client.get("/jobs", headers={"authorization": f"Bearer {bad}"}).status_code == 401
        client.headers["authorization"] = f"Bearer {good}"
        number = client.post("/jobs", json=JOB).json()["id"]
        wait_for(lambda: client.get(f"/jobs/{number}").json()["state"] == "done", 90)
    return int(number)


def answers(client: httpx.Client) -> bool:
    try:
        return client.get("/jobs").status_code == 401
    except httpx.TransportError:
        return False
