"""Estimates beside a measurement: the very plan that is timed, compiled for the usual GPUs where the tools are."""

from __future__ import annotations

from typing import Any

from renderer.host import Host
from renderer.phone_compile.counted import count_frame
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.estimate import estimate_all
from renderer.phone_compile.gpus import GPUS, USUAL
from renderer.phone_compile.result import model_of
from renderer.phone_compile.toolchain import MissingError, tool_chain
from renderer.plan import Plan, PlanError
from renderer.prepare import Prepared
from renderer.records import Records
from renderer.twin_host import TwinHost


def compiled_model(prepared: Prepared, timed: Plan, records: Records, host: Host) -> dict[str, Any] | None:
    """The estimates of USUAL by GPU; None without the tool chain, or where the frame cannot be counted.

    `records` are those of the instrumented plan. The machine's lock must be held: sites are counted on the twin.
    """
    twin = host if host.device()["kind"] == "twin" else TwinHost(prepared.request.threads)
    try:
        chain = tool_chain()
        frame = count_frame(prepared, timed, twin, records)
    except (MissingError, CompileError, PlanError):
        return None
    estimates = estimate_all(chain, [GPUS[name] for name in USUAL], timed, frame)
    return model_of([estimate.as_dict() for estimate in estimates])
