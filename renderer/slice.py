"""One slice: one round of one job, measured in a process of its own (`python -m renderer.slice`).

`renderer.child` says how the request goes in and the measurement comes out.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from renderer.accuracy import judge
from renderer.child import answer_task
from renderer.instrumented import instrumented, refuse_cut
from renderer.oracle import Oracle
from renderer.plan import VERSION, Plan
from renderer.planner import in_passes
from renderer.prepare import Prepared, prepare
from renderer.records import COUNTERS, Records
from renderer.request import Request
from renderer.twin import Frames, Twin, open_context

Measurement = dict[str, Any]

WARM_UP = 1
"""Frames run and dropped before the timed ones: the first compiles."""


def measure(request: Request, round_index: int) -> Measurement:
    """Measure one round here: counters and errors in the first round, frame times in each."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    prepared = prepare(request)
    context = open_context()
    wants_records = round_index == 0 or request.vs_embree
    records = instrumented(prepared, context) if wants_records else None
    oracle = None
    if request.vs_embree or (round_index == 0 and request.check != "none"):
        oracle = Oracle(prepared.scene.vertices, prepared.scene.faces)

    plan = prepared.plan(instrument=False)
    against = None
    if request.vs_embree and oracle is not None and records is not None:
        against = _embree_frame(request, oracle, records)
    frames, embree, compile_s = _timed(context, plan, _frames_of(request, round_index), against)
    measurement: Measurement = {
        "round": round_index,
        "started_at": started,
        "device": _device(context, request),
        "frames": asdict(frames),
        "embree_cpu": embree,
        "compile_s": compile_s,
        "load_average": os.getloadavg()[0],
    }
    if round_index == 0:
        assert records is not None
        errors = judge(prepared.scene.triangles, records, oracle, _referee_tree(prepared), request.check)
        measurement |= _facts(prepared, plan, records) | {"error": asdict(errors)}
    return measurement


def _referee_tree(prepared: Prepared) -> Any:
    return prepared.referee_tree() if prepared.request.check == "referee" else None


def _timed(
    context: Any, plan: Plan, count: int, against: Callable[[], float] | None
) -> tuple[Frames, list[float], float]:
    """Frame times, Embree's CPU seconds between the frames, and the seconds until the first frame was done."""
    begun = time.perf_counter()
    twin = Twin(context, plan)
    twin.setup()
    for _ in range(WARM_UP):
        twin.frame()
    compile_s = time.perf_counter() - begun
    embree: list[float] = []
    if against is not None:
        against()
    frames = twin.time_frames(count, lambda: embree.append(against()) if against is not None else None)
    refuse_cut(int((twin.image()[..., 3] == 0).sum()))
    return frames, embree, compile_s


def _embree_frame(request: Request, oracle: Oracle, records: Records) -> Callable[[], float]:
    """A function that traces what was timed, ray for ray, with Embree and returns the CPU seconds."""
    traces: list[Callable[[], object]] = []
    if request.rays != "shadow" and not records.rasterised:
        traces.append(partial(oracle.trace_closest, records.primary))
    if request.rays != "primary":
        traces.append(partial(oracle.trace_occluded, records.shadow))

    def trace() -> float:
        begun = time.process_time()
        for one in traces:
            one()
        return time.process_time() - begun

    return trace


def _frames_of(request: Request, round_index: int) -> int:
    """This round's share of the frames."""
    share, rest = divmod(request.frames, request.rounds)
    return share + (round_index < rest)


def _facts(prepared: Prepared, plan: Plan, records: Records) -> Measurement:
    tree = prepared.tree
    return {
        "triangles": len(prepared.scene.faces),
        "cost": None if tree is None else tree.cost,
        "depth": None if tree is None else tree.depth,
        "build_ms": prepared.build_ms,
        "structure_bytes": prepared.packed.structure_bytes,
        "primitive_bytes": prepared.packed.primitives.nbytes,
        "rays": {"primary": 0 if records.rasterised else len(records.primary), "shadow": len(records.shadow)},
        "per_ray": _per_ray(prepared, records),
        "specialised": list(plan.left_out),
        "versions": {
            "rayfarm": version("rayfarm"),
            "shader_sha": plan.shader_sha,
            "plan": VERSION,
            "embreex": version("embreex"),
        },
    }


def _per_ray(prepared: Prepared, records: Records) -> dict[str, float] | None:
    """Means over the rays that are timed; None where brute force ran in passes, which do not carry counters."""
    request = prepared.request
    if in_passes(prepared.scene, prepared.tree):
        return None
    counted = []
    if request.rays != "shadow" and not records.rasterised:
        counted.append(records.primary_counts)
    if request.rays != "primary":
        counted.append(records.shadow_counts)
    counts = np.concatenate(counted).astype(np.float64)
    means = counts.mean(axis=0) if len(counts) else np.zeros(len(COUNTERS))
    figures = dict(zip(COUNTERS, means.tolist(), strict=True))
    return figures | {"bytes": figures.pop("words") * 4}


def _device(context: Any, request: Request) -> dict[str, Any]:
    info = context.info
    return {
        "id": "llvmpipe" if "llvmpipe" in info["GL_RENDERER"] else "egl",
        "kind": "twin",
        "name": info["GL_RENDERER"],
        "driver": info["GL_VERSION"],
        "vendor": info["GL_VENDOR"],
        "threads": request.threads,
        "cores": os.cpu_count(),
        "machine": platform.machine(),
    }


def _work(task: dict[str, Any]) -> Measurement:
    return measure(Request.from_json(task["request"]), task["round"])


if __name__ == "__main__":
    answer_task(_work)
