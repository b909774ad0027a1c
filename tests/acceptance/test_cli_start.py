"""What the command line loads before it has work to do: nothing that measures, stores or serves."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from service_fakes import Service, running_service
from typer.core import TyperGroup
from typer.main import get_command

from server.cli import app as cli

HEAVY = ("dbos", "fastapi", "numba", "numpy", "pandas", "sqlalchemy", "trimesh")

PROGRAM = """
import json, sys
from server.cli.app import run
code = run(sys.argv[1:])
print(json.dumps({"code": code, "modules": sorted(sys.modules)}), file=sys.stderr)
"""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


def start(*words: str) -> tuple[int, str, list[str]]:
    """Exit code, output, and the heavy packages that were loaded, of one verb in a process of its own."""
    command = [sys.executable, "-c", PROGRAM, *words]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    told = json.loads(ended.stderr.splitlines()[-1])
    return told["code"], ended.stdout, [name for name in HEAVY if name in told["modules"]]


def verbs() -> list[str]:
    """Every verb that there is."""
    group = get_command(cli.app)
    assert isinstance(group, TyperGroup)
    return list(group.commands)


def test_the_heavy_packages_are_called_so() -> None:
    assert [name for name in HEAVY if find_spec(name) is None] == []


@pytest.mark.parametrize("words", [[], *([verb] for verb in verbs())], ids=" ".join)
def test_help_loads_nothing_heavy(words: list[str]) -> None:
    code, out, heavy = start(*words, "--help")
    assert code == 0
    assert "Usage: rayfarm" in out
    assert heavy == []


def test_verbs_that_speak_to_a_service_load_nothing_heavy(service: Service) -> None:
    there = ("--server", address(service))
    with service.working():
        posted = start("submit", "cornell-box", "--frames", "1", "--size", "32", *there)
        studied = start("study", "demo", *there)
    compared = start("compare", *there)
    listed = start("devices", *there)
    ended = (posted, studied, compared, listed)
    assert [code for code, *_ in ended] == [0, 0, 0, 0]
    assert ["bvh-stack" in out for _, out, _ in ended[:3]] == [True, True, True]
    assert "No device yet" in listed[1]
    assert [heavy for *_, heavy in ended] == [[], [], [], []]


def address(service: Service) -> str:
    return str(service.client.base_url)
