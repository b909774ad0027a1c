"""Each service of docker-compose.yml, its command and health check run as the file has them, on a real PostgreSQL."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from compose_file import ROOT
from composed import VARIABLES, Composed, composed
from postgres import find_binaries
from private_host import first_child, refusal

WORDS = ["cornell-box", "--traversal", "bvh-stack", "--size", "32", "--frames", "1", "--rounds", "1", "--json"]
PHONE = "127.0.0.1:15555"


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Composed]:
    binaries, reason = find_binaries(), refusal()
    if binaries is None or reason is not None:
        pytest.skip(reason or "PostgreSQL's server programs are not installed: apt install postgresql")
    with composed(tmp_path_factory.mktemp("farm"), binaries) as running:
        yield running


@pytest.fixture(scope="module")
def refused(farm: Composed) -> str:
    """What the server said when there was no token yet."""
    farm.start("server")
    assert farm.running.pop("server").wait(60) != 0
    return farm.log("server")


@pytest.fixture(scope="module")
def token(farm: Composed, refused: str) -> str:
    """A token, made as the file's first lines say; then server and llvmpipe worker run."""
    made = farm.run("server", ["rayfarm", "tokens", "create", "admin", "--scope", "admin"])
    assert made.returncode == 0, made.stderr
    for service in ("server", "llvmpipe-worker"):
        farm.start(service)
        farm.wait_until_healthy(service)
    return made.stdout.strip()


def submitted(farm: Composed, token: str, *words: str) -> dict[str, Any]:
    """The study of one job, sent to the server over HTTP."""
    sent = farm.run("server", ["rayfarm", "submit", *WORDS, *words], RAYFARM_TOKEN=token)
    assert sent.returncode == 0, sent.stdout + sent.stderr
    found: dict[str, Any] = json.loads(sent.stdout)
    return found


def test_the_server_starts_with_a_token_only(refused: str) -> None:
    assert "make one with `rayfarm tokens create NAME --scope admin`" in refused


def test_a_job_is_measured_by_the_llvmpipe_worker(farm: Composed, token: str) -> None:
    found = submitted(farm, token)
    assert found["study"]["jobs_by_state"]["done"] == 1
    assert "bvh-stack" in farm.log("llvmpipe-worker")
    assert list((farm.folder / "data").rglob("*.gz"))  # Its picture, where the server shows it from.
    assert (farm.folder / "data" / "locks" / "rayfarm-measuring.lock").exists()


def test_a_request_without_a_token_is_refused(farm: Composed, token: str) -> None:
    sent = farm.run("server", ["rayfarm", "submit", *WORDS])
    assert sent.returncode == 2
    assert "needs a token" in sent.stderr


def test_other_names_and_the_network_s_are_told_apart(farm: Composed, token: str) -> None:
    for name, good in (("server", True), ("database", False)):
        answer = farm.run("llvmpipe-worker", ["rayfarm", "doctor", "service"], RAYFARM_SERVER=f"http://{name}:8710")
        assert (answer.returncode == 0) == good, answer.stdout


@pytest.mark.parametrize("service", ["adb-worker", "adb-host-worker"])
def test_a_phone_is_measured_by_an_adb_worker(farm: Composed, token: str, phone: str, service: str) -> None:
    """The second finds the adb server that the first one started, as one that the host runs."""
    farm.start(service)
    farm.wait_until_healthy(service)
    attached = farm.run("server", ["rayfarm", "devices", "attach", phone, "--json"], RAYFARM_TOKEN=token)
    assert attached.returncode == 0, attached.stdout + attached.stderr + farm.log(service)
    found = submitted(farm, token, "--device", phone)
    assert found["study"]["jobs_by_state"]["done"] == 1
    assert farm.stop(service) == 0
    assert farm.health(service).returncode == 1


def test_no_password_and_no_token_is_in_a_log(farm: Composed, token: str) -> None:
    said = "".join(farm.log(service) for service in farm.file["services"])
    assert "RayFarm serves at" in said
    assert VARIABLES["RAYFARM_DATABASE_PASSWORD"] not in said
    assert token not in said


def test_services_end_when_they_are_told_and_are_healthy_no_longer(farm: Composed, token: str) -> None:
    """Last of all: it ends them."""
    for service in ("llvmpipe-worker", "server"):
        assert farm.stop(service) == 0
        said = farm.health(service)
        assert said.returncode == 1
        assert "start `rayfarm" in said.stdout


@pytest.fixture(scope="module")
def phone(farm: Composed) -> Iterator[str]:
    """A stand-in phone beside the services."""
    command = farm.host.command([sys.executable, "-m", "agent_android.standin", "--port", PHONE.rpartition(":")[2]])
    environment = dict(os.environ) | {"PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, env=environment, **pipes) as standing_in:
        assert standing_in.stdout is not None
        if PHONE not in standing_in.stdout.readline():
            pytest.skip(f"no stand-in phone: {standing_in.communicate()[1].strip()[-300:]}")
        yield PHONE
        os.kill(first_child(standing_in.pid), signal.SIGTERM)
