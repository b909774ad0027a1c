"""The pinned packages: all of them, and none that an older Python of those that RayFarm takes would refuse."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import distributions
from pathlib import Path

from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]


PINS = re.findall(r"^([\w.-]+)==", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
PINNED = {canonicalize_name(name) for name in PINS}


def test_the_oldest_python_takes_every_pinned_package() -> None:
    """pip finds no way out when one is refused, and says so after a quarter of an hour."""
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    oldest = asked.removeprefix(">=") + ".0"
    found = {canonicalize_name(each.name): each.metadata["Requires-Python"] or "" for each in distributions()}
    assert len(PINNED & found.keys()) > 100
    refusing = {name: found[name] for name in PINNED & found.keys() if oldest not in SpecifierSet(found[name])}
    assert refusing == {}


def test_all_that_is_installed_is_pinned() -> None:
    """What is not pinned changes under us."""
    assert {canonicalize_name(each.name) for each in distributions()} - PINNED == {"rayfarm"}
