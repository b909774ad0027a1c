"""What docker-compose.yml and the Dockerfile promise, read from them: pins, users, ports, and files that are there."""

from __future__ import annotations

import re
import shlex
from fnmatch import fnmatch
from typing import Any

import pytest
from compose_file import ROOT, image_environment, read_compose, read_dockerfile

from server.settings import Settings

PASSWORD = {"RAYFARM_DATABASE_PASSWORD": "secret"}
SERVICES = read_compose(PASSWORD)["services"]
each_service = pytest.mark.parametrize("service", SERVICES.values(), ids=SERVICES)
INSTALLED = {"make", "postgresql-client", "python3", "python3-venv"}
"""What the Dockerfile installs itself: tools/system_packages.sh knows the rest."""


def test_a_password_must_be_given() -> None:
    with pytest.raises(ValueError, match="RAYFARM_DATABASE_PASSWORD"):
        read_compose({})


@each_service
def test_images_are_pinned(service: dict[str, Any]) -> None:
    assert re.fullmatch(r"[a-z]+:\d+\.\d+[a-z0-9.-]*", service["image"])


@each_service
def test_nothing_runs_as_root(service: dict[str, Any]) -> None:
    assert service["user"].partition(":")[0] not in ("", "0", "root")
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert not service.get("privileged")


@each_service
def test_every_service_is_checked_and_started_again(service: dict[str, Any]) -> None:
    assert service["healthcheck"]["test"][0] == "CMD"
    assert service["restart"] == "unless-stopped"


@each_service
def test_ports_are_open_to_this_machine_alone_unless_another_address_is_given(service: dict[str, Any]) -> None:
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))


@each_service
def test_volumes_are_declared_or_devices(service: dict[str, Any]) -> None:
    declared = read_compose(PASSWORD)["volumes"]
    for volume in service.get("volumes", []):
        source = volume.partition(":")[0]
        assert source in declared or source.startswith("/dev/")


@each_service
def test_settings_are_ones_that_the_program_knows(service: dict[str, Any]) -> None:
    given = {name for name in service["environment"] if name.startswith("RAYFARM_")}
    assert given <= {f"RAYFARM_{name.upper()}" for name in Settings.model_fields}


def test_both_workers_of_a_machine_share_their_locks() -> None:
    """Else a measurement on llvmpipe and work for a phone would overlap."""
    assert image_environment()["RAYFARM_LOCKS"].startswith("/var/lib/rayfarm/")
    for name in ("llvmpipe-worker", "adb-worker", "adb-host-worker"):
        assert "data:/var/lib/rayfarm" in SERVICES[name]["volumes"]


def test_workers_have_names_of_their_own() -> None:
    """A name is a queue: a phone's jobs must not wait for the llvmpipe worker."""
    names = {SERVICES[name]["environment"]["RAYFARM_WORKER_HOST"] for name in ("llvmpipe-worker", "adb-worker")}
    assert len(names) == 2


def test_what_is_copied_into_the_image_is_there() -> None:
    ignored = [line for line in (ROOT / ".dockerignore").read_text().split() if not line.startswith("**")]
    for word, rest in read_dockerfile():
        if word == "COPY" and not rest.startswith("--from="):
            for source in rest.split()[:-1]:
                assert (ROOT / source).exists(), source
                assert not any(fnmatch(source, pattern) for pattern in ignored), source


def test_stages_are_pinned_or_the_file_s_own() -> None:
    stages: list[str] = []
    for word, rest in read_dockerfile():
        if word == "ARG":
            assert re.fullmatch(r"BASE=debian:trixie-\d{8}-slim", rest)
        if word == "FROM":
            base, _, name = rest.partition(" AS ")
            assert base in ("${BASE}", *stages)
            stages.append(name)
        if word == "COPY" and rest.startswith("--from="):
            assert rest.removeprefix("--from=").split()[0] in stages


def test_the_image_s_packages_are_those_of_the_makefile() -> None:
    runs = [rest for word, rest in read_dockerfile() if word == "RUN"]
    commands = [shlex.split(part) for rest in runs for part in rest.split("&&")]
    named = {
        word
        for words in commands
        if words[:2] == ["apt-get", "install"]
        for word in words[2:]
        if not word.startswith("-")
    }
    assert named == INSTALLED
    called = [" ".join(words) for words in commands]
    assert {"tools/system_packages.sh run", "tools/system_packages.sh agent", "make"} <= set(called)
    makefile = (ROOT / "Makefile").read_text()
    assert "tools/system_packages.sh run" in makefile
    assert "$(BIN)/python -m agent_android.build\n" in makefile


def test_the_image_runs_as_the_user_of_the_compose_file() -> None:
    users = [rest for word, rest in read_dockerfile() if word == "USER"]
    assert users == [SERVICES["server"]["user"]]
