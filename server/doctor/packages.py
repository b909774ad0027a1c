"""Python and its packages, against `constraints.txt`, and the programs that are called by name."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path

from server.doctor.finding import Said

ROOT = Path(__file__).resolve().parents[2]
OLDEST = (3, 11)
AGAIN = "run `rm -f .venv/.ready && make`"
PROGRAMS = {"glslangValidator": "glslang-tools"}
"""Programs that measuring calls, and Debian's packages of them."""
SHOWN = 4


def python(version: tuple[int, ...] = sys.version_info[:3]) -> Iterator[Said]:
    """Whether this Python is recent enough."""
    shown = ".".join(map(str, version))
    if version < OLDEST:
        yield "missing", f"Python {shown} is too old: run `make PYTHON=python3.11`, or a later one."
    else:
        yield "good", f"Python {shown}."


def packages(constraints: Path = ROOT / "constraints.txt") -> Iterator[Said]:
    """Whether what is installed is what was tested."""
    installed: dict[str, str] = {}
    for each in metadata.distributions():
        installed.setdefault(_plain(each.name), each.version)  # The first on the path is the one that is loaded.
    wanted = {_plain(_name(each)) for each in metadata.requires("rayfarm") or [] if "extra ==" not in each}
    absent = sorted(wanted - installed.keys())
    if absent:
        yield "missing", f"{_listed(absent)} {'is' if len(absent) == 1 else 'are'} not installed: {AGAIN}."
    try:
        pinned = _pins(constraints.read_text(encoding="utf-8"))
    except OSError:
        yield "note", f"There is no {constraints}: versions of packages are not compared with those that were tested."
        return
    others = [
        f"{name} {installed[name]} (not {pin})" for name, pin in pinned.items() if installed.get(name, pin) != pin
    ]
    if others:
        yield "missing", f"Other versions than those tested are installed, {_listed(others)}: {AGAIN}."
    elif not absent:
        yield "good", f"{len(wanted)} packages and what they need, as constraints.txt has them."


def programs() -> Iterator[Said]:
    """Whether programs that measuring calls are on the PATH."""
    for program, package in PROGRAMS.items():
        where = shutil.which(program)
        if where is None:
            yield "missing", f"{program} is not on the PATH: install {package} (apt-get install {package})."
        else:
            yield "good", f"{program} at {where}."


def _pins(text: str) -> Mapping[str, str]:
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    return {_plain(name): version for name, mark, version in (line.partition("==") for line in lines) if mark}


def _name(requirement: str) -> str:
    return re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]


def _plain(name: str) -> str:
    """A package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _listed(words: list[str]) -> str:
    more = f" and {len(words) - SHOWN} more" if len(words) > SHOWN else ""
    return ", ".join(words[:SHOWN]) + more
