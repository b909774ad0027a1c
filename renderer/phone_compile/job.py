"""One variant compiled for several GPUs, in a process of its own (`python -m renderer.phone_compile.job`).

`renderer.child` says how the task goes in and the rows come out.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from renderer.answering import Json, Say, answer_task, silent, tell_note
from renderer.child import run_child
from renderer.host import Host
from renderer.locks import holding, machine_lock
from renderer.phone_compile.counted import Frame, count_frame, tracing_program
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.estimate import Estimate, estimate_all
from renderer.phone_compile.gpus import Gpu, require_gpus
from renderer.phone_compile.task import MODULE, task_of
from renderer.phone_compile.toolchain import tool_chain
from renderer.plan import VERSION, Plan, PlanError
from renderer.prepare import Prepared, prepare
from renderer.request import Request
from renderer.twin_host import TwinHost


def compile_request(
    request: Request, gpus: Sequence[Gpu], timeout_s: float = 900.0, *, disassembly: bool = False, say: Say = silent
) -> Json:
    """The document of one variant on several GPUs, made in a fresh child process.

    Raise CompileError where there is no tool chain, ChildError with the reason when the child fails.
    """
    tool_chain()
    task = task_of(request.to_json(), [gpu.name for gpu in gpus], disassembly=disassembly)
    return run_child(MODULE, task, request.threads, timeout_s, say)


def compile_prepared(prepared: Prepared, gpus: Sequence[Gpu], host: Host, *, disassembly: bool = False) -> Json:
    """The same here; the locks of the machine and of the host must be held."""
    started_at = datetime.now(UTC).isoformat(timespec="seconds")
    plan = prepared.plan(instrument=False)
    chain = tool_chain()
    frame, reason = _frame(prepared, plan, host)
    estimates = estimate_all(chain, gpus, plan, frame, disassembly=disassembly)
    return _document(prepared, plan, estimates, reason, started_at, disassembly=disassembly)


def _frame(prepared: Prepared, plan: Plan, host: Host) -> tuple[Frame | None, str | None]:
    """What a frame does, or why that is not known: the static figures are there all the same."""
    try:
        return count_frame(prepared, plan, host), None
    except (CompileError, PlanError) as error:
        return None, str(error)


def _document(
    prepared: Prepared,
    plan: Plan,
    estimates: Sequence[Estimate],
    reason: str | None,
    started_at: str,
    *,
    disassembly: bool,
) -> Json:
    """What all rows share, and a row for each GPU; with `disassembly` the GLSL that it stands beside."""
    request = prepared.request
    tree, packed = prepared.tree, prepared.packed
    rows = [estimate.as_dict() for estimate in estimates]
    for row in rows:
        row["reason"] = row["reason"] or reason
    shared: dict[str, Any] = {
        "scene": request.scene,
        "triangles": len(prepared.scene.faces),
        **request.variant.as_dict(),
        "size": list(request.size),
        "rays_kind": request.rays,
        "sah": {
            "traversal": request.costs.traversal,
            "intersection": request.costs.intersection,
            "cost": None if tree is None else tree.cost,
        },
        "depth": None if tree is None else tree.depth,
        "structure_bytes": packed.structure_bytes,
        "primitive_bytes": packed.primitives.nbytes,
        "build_ms": prepared.build_ms,
        "specialised": list(plan.left_out) if request.specialise else None,
        "versions": {"rayfarm": version("rayfarm"), "shader_sha": plan.shader_sha, "plan": VERSION},
        "started_at": started_at,
        "gpus": rows,
    }
    if disassembly:
        program, stage = tracing_program(plan)
        shared["glsl"] = program.stages[stage]
    return shared


def _work(task: Json, say: Say) -> Json:
    request = Request.from_json(task["request"])
    gpus = require_gpus(",".join(task["gpus"]))
    host = TwinHost(request.threads)
    # Our own heavy work and a measurement never overlap: the whole of it holds the machine, which is the twin's device.
    with holding(machine_lock(), lambda: say("waiting")):
        say("preparing")
        prepared = prepare(request, note=tell_note)
        say("running")
        return compile_prepared(prepared, gpus, host, disassembly=bool(task.get("disassembly")))


if __name__ == "__main__":
    answer_task(_work)
