"""The pinned packages against the oldest Python that pyproject.toml allows: Debian 12 has 3.11.2."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import distributions
from pathlib import Path

from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
OLDEST = next(iter(SpecifierSet(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"])))


def test_every_package_takes_the_oldest_python() -> None:
    """Where one does not, pip tries every older version of all that needs it, and gives up."""
    wanted = {package.name: package.metadata.get("Requires-Python") or "" for package in distributions()}
    assert not {
        name: wants for name, wants in wanted.items() if not SpecifierSet(wants).contains(f"{OLDEST.version}.0")
    }


def test_all_that_is_installed_is_pinned() -> None:
    """What is not pinned changes under us, and no test here says when."""
    pinned = {
        _plain(line.split("==")[0]) for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line
    }
    assert {_plain(package.name) for package in distributions()} - pinned <= {"rayfarm"}


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
