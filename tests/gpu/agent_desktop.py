"""Runs the phone agent directly on this machine: its DEX turned back into classes, over the desktop shim.

`Batch` runs many commands in one process; `start` and `run_main` start the agent's own Main, as a phone would.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest

from renderer.plan import Plan
from server.devices.agent_record import AgentRecord, read_record

AGENT = Path(__file__).parents[2] / "agent_android"
MAIN = "org.rayfarm.agent.Main"
DEADLINE_S = 60.0
PATIENCE_S = 90.0
"""A hung process is ended after this; the agent's own deadline comes first."""

_NEEDED = ("javac", "mvn", "enjarify")
_tokens = itertools.count()


@cache
def version() -> str:
    """Build the agent and its desktop if they are not up to date; the version that both sides must agree on."""
    missing = [program for program in _NEEDED if shutil.which(program) is None]
    if missing:
        pytest.skip(f"the agent cannot be built here without {', '.join(missing)}")
    build = [sys.executable, "-m", "agent_android.build", "desktop"]
    built = subprocess.run(build, cwd=AGENT.parent, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return str(json.loads(built.stdout)["version"])


def command(main: str, *words: str) -> list[str]:
    """The command line that runs a class on the desktop."""
    version()
    return [str(AGENT / "desktop" / "run.sh"), str(AGENT / "build" / "agent-desktop.jar"), main, *words]


def environment(switches: Mapping[str, str] | None = None) -> dict[str, str]:
    """One rasteriser thread, and the shim's switches (README.md)."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("RAYFARM_SHIM_")}
    return {**kept, "LP_NUM_THREADS": "1", **(switches or {})}


def words(verb: str, out: Path, token: str, deadline: float = DEADLINE_S) -> list[str]:
    """The options that every verb takes."""
    return [verb, "--version", version(), "--token", token, "--out", str(out), "--deadline", str(deadline)]


def run_words(plan: Path, frames: int = 1, warm_up: int = 1) -> list[str]:
    """The further options of `run`."""
    return ["--plan", str(plan), "--frames", str(frames), "--warm-up", str(warm_up)]


def start(arguments: list[str], switches: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
    """The agent's Main in a process of its own, its standard input held open."""
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command(MAIN, *arguments), stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=environment(switches)
    )


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Its exit code, standard output and error once it ended by itself; standard input is held until then."""
    assert process.stdin is not None
    try:
        code = process.wait(PATIENCE_S)
    finally:
        process.kill()
    process.stdin.close()
    process.stdin = None
    out, err = process.communicate()
    return code, out, err


class Batch:
    """Many commands in one process."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="rayfarm-agent-")
        self.folder = Path(self._folder.name)
        self._process = subprocess.Popen(
            command("org.rayfarm.desktop.Batch"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(),
        )

    def __enter__(self) -> Batch:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.close()
            self._process.wait(PATIENCE_S)
        finally:
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()
            self._folder.cleanup()

    def ask(self, task: dict[str, Any], switches: Mapping[str, str] | None = None) -> str:
        """One line in, one line out."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(task | {"env": dict(switches or {})}) + "\n")
        self._process.stdin.flush()
        return self._process.stdout.readline().strip()

    def run(
        self,
        plan: Plan | Path,
        switches: Mapping[str, str] | None = None,
        *more: str,
        frames: int = 1,
        warm_up: int = 1,
    ) -> AgentRecord:
        """The record of one run of a plan or of a plan's file."""
        path = plan if isinstance(plan, Path) else self.folder / "plan"
        if isinstance(plan, Plan):
            plan.save(path)
        return self.record("run", switches, *run_words(path, frames, warm_up), *more)

    def record(self, verb: str, switches: Mapping[str, str] | None = None, *more: str) -> AgentRecord:
        """The record of one command; the exit code says the same as its outcome, and nothing else is left."""
        token, out = f"token-{next(_tokens)}", self.folder / "record"
        code = self.ask({"args": [*words(verb, out, token), *more]}, switches)
        found = read_record(out, token, version())
        assert code == ("0" if found.outcome == "done" else "1"), code
        out.unlink()
        assert {file.name for file in self.folder.iterdir()} <= {"plan"}
        return found
