"""Programs compiled for one GPU in a process of its own, which is ended in time and may crash."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.gpus import Gpu
from renderer.phone_compile.toolchain import ToolChain

TIME_LIMIT_S = 120.0
DRIVER = "renderer.phone_compile.driver"

Stages = Mapping[str, str]
"""A program's texts by stage."""


@dataclass(frozen=True)
class Compiled:
    """What the driver said of one program: `complaint` why it took none, `messages` of KHR_debug, what it printed."""

    complaint: str | None
    messages: tuple[str, ...]
    listing: str


@dataclass(frozen=True)
class Answer:
    """What a driver says of itself, limits by GL name without `GL_MAX_`, and of the programs in their order.

    `ended` says why the last programs are missing, where the driver did not get to them.
    """

    renderer: str
    version: str
    limits: Mapping[str, int]
    programs: tuple[Compiled, ...]
    ended: str | None = None


def compile_programs(
    chain: ToolChain, gpu: Gpu, programs: Sequence[Stages], time_limit_s: float = TIME_LIMIT_S, module: str = DRIVER
) -> Answer:
    """Compile programs for a GPU; raise CompileError where its driver cannot even be asked."""
    order = json.dumps({"parent": os.getpid(), "programs": [dict(stages) for stages in programs]}) + "\n"
    command = [sys.executable, "-m", module]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=chain.environment(gpu),
        text=True,
    ) as process:
        try:
            output, _ = process.communicate(order, timeout=time_limit_s)
            ended = _crashed(gpu, process.returncode)
        except subprocess.TimeoutExpired as late:
            process.kill()
            output = (late.stdout or b"").decode(errors="replace") if isinstance(late.stdout, bytes) else ""
            output = output or process.communicate()[0]
            ended = f"Mesa's driver for {gpu.name} was ended after {time_limit_s:g} s: it hangs on this text."
    lines = [_read(line) for line in output.splitlines(keepends=True) if line.endswith("\n")]
    return _answer(gpu, lines, len(programs), ended)


def _answer(gpu: Gpu, lines: list[dict[str, Any]], wanted: int, ended: str | None) -> Answer:
    error = next((line["error"] for line in lines if "error" in line), None)
    if error is not None:
        ended = f"Mesa's driver for {gpu.name} gives nothing: {error}."
    if not lines or "limits" not in lines[0]:
        raise CompileError(ended or f"Mesa's driver for {gpu.name} gave no answer.")
    first, *rest = lines
    if gpu.model not in first["renderer"].lower():
        raise CompileError(
            f"Mesa's driver for {gpu.name} came up as {first['renderer']}: build the compilers again "
            "(`make phone-compiler`, after removing their folder)."
        )
    programs = tuple(
        Compiled(line["complaint"], tuple(line["messages"]), line["listing"]) for line in rest if "listing" in line
    )
    if len(programs) < wanted and ended is None:
        ended = f"Mesa's driver for {gpu.name} stopped before it was done."
    return Answer(first["renderer"], first["version"], first["limits"], programs, ended)


def _crashed(gpu: Gpu, code: int) -> str | None:
    if code == 0:
        return None
    how = f"signal {-code}" if code < 0 else f"code {code}"
    return f"Mesa's driver for {gpu.name} crashed on this text ({how})."


def _read(line: str) -> dict[str, Any]:
    try:
        read = json.loads(line)
    except ValueError:
        return {}
    return read if isinstance(read, dict) else {}
