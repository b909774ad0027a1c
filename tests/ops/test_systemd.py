"""The units of `deploy/`: systemd takes them, they are shut in, and their commands and settings are the program's."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from server.doctor.phones import RULES
from server.settings import Settings

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
PROGRAM = "/opt/rayfarm/.venv/bin/rayfarm"
MOST_EXPOSED = 25
"""systemd's figure in tenths: 0 is shut in, 100 is open."""
services = pytest.mark.parametrize("service", sorted(path.name for path in DEPLOY.glob("*.service")))


@pytest.fixture
def analyze() -> str:
    found = shutil.which("systemd-analyze")
    if found is None:
        pytest.skip("systemd-analyze is not installed: apt install systemd")
    return found


@pytest.fixture
def units(tmp_path: Path) -> Path:
    """The units with this program in the place of the installed one."""
    program = str(Path(sys.executable).parent / "rayfarm")
    for unit in (*DEPLOY.glob("*.service"), *DEPLOY.glob("*.target")):
        (tmp_path / unit.name).write_text(unit.read_text().replace(PROGRAM, program))
    return tmp_path


def test_systemd_finds_nothing_wrong(analyze: str, units: Path) -> None:
    files = [str(path) for path in sorted(units.iterdir())]
    said = subprocess.run([analyze, "verify", "--man=no", *files], capture_output=True, text=True, check=False)
    ours = [line for line in said.stderr.splitlines() if "rayfarm" in line]
    assert (said.returncode, ours) == (0, [])


def test_udev_finds_nothing_wrong() -> None:
    udevadm = shutil.which("udevadm")
    if udevadm is None or subprocess.run([udevadm, "verify", "--help"], capture_output=True, check=False).returncode:
        pytest.skip("there is no udevadm that verifies rules: it came with systemd 254")
    said = subprocess.run(
        [udevadm, "verify", "--resolve-names=never", str(DEPLOY / RULES)], capture_output=True, text=True, check=False
    )
    assert said.returncode == 0, said.stdout + said.stderr


@services
def test_services_are_shut_in(analyze: str, service: str) -> None:
    words = ["security", "--offline=yes", f"--threshold={MOST_EXPOSED}", "--no-pager", str(DEPLOY / service)]
    said = subprocess.run([analyze, *words], capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stdout[-400:] + said.stderr


@services
def test_commands_and_settings_are_the_program_s(service: str) -> None:
    text = (DEPLOY / service).read_text()
    (command,) = re.findall(r"^ExecStart=(.*)$", text, re.MULTILINE)
    program, *words = command.split()
    assert program == PROGRAM
    help_of = [sys.executable, "-m", "server.cli.app", *words, "--help"]
    assert subprocess.run(help_of, cwd=ROOT, capture_output=True, check=False).returncode == 0
    known = {f"RAYFARM_{name.upper()}" for name in Settings.model_fields} | {"RAYFARM_LOCKS", "RAYFARM_CACHE"}
    assert set(re.findall(r"\b(RAYFARM_[A-Z_]+)=", text)) <= known


def test_a_child_s_memory_does_not_end_its_worker() -> None:
    """systemd's default ends the whole service when the kernel ends one of its processes for its memory."""
    assert "OOMPolicy=continue" in (DEPLOY / "rayfarm-worker.service").read_text()
