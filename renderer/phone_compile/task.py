"""The task of a process that compiles one variant; imports nothing heavy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

MODULE = "renderer.phone_compile.job"


def task_of(request: dict[str, Any], gpus: Sequence[str], *, disassembly: bool) -> dict[str, Any]:
    """What `renderer.phone_compile.job` reads; `disassembly` adds the GLSL and each GPU's listing to its rows."""
    return {"request": request, "gpus": list(gpus), "disassembly": disassembly}
