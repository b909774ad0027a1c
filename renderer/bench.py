"""Jobs from slices: runs each slice in a child process and combines a job's measurements into its result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from renderer.answering import Say, silent
from renderer.child import ChildError, run_child
from renderer.phone_compile.result import result_of
from renderer.request import Request
from renderer.times.interval import median, median_interval

Result = dict[str, Any]
RunSlice = Callable[[Request, int], dict[str, Any]]

_ERRORS = (
    "false_hit", "false_miss", "edge", "wrong_primitive", "t_rel_p99", "t_rel_max", "t_ulp_max", "shadow_mismatch",
    "shadow_edge", "shadow_self_hit", "shadow_leak", "raster_mismatch", "flip", "psnr",
)  # fmt: skip


def run_slice(
    request: Request, round_index: int, timeout_s: float = 900.0, *, pictures: Path | None = None, note: Say = silent
) -> dict[str, Any]:
    """Run one slice in a fresh child process and return its measurement; raise ChildError with the reason if it fails.

    A slice may measure for `timeout_s` seconds; waiting for another measurement on this host does not count. The first
    round's pictures go into the folder `pictures` (`renderer.pictures.files`). `note` hears how far a long build is.
    """
    task = {"request": request.to_json(), "round": round_index, "pictures": None if pictures is None else str(pictures)}
    return run_child("renderer.slice", task, request.threads, timeout_s, note=note)


def run_jobs(
    requests: Sequence[Request], progress: Callable[[Request, int], None], run: RunSlice = run_slice
) -> list[Result | ChildError]:
    """Run jobs, interleaved in rounds, and return each one's result or the error that ended it.

    `run` measures one slice, by default here on the twin; it raises ChildError with the reason when that fails.
    """
    measured: list[list[dict[str, Any]]] = [[] for _ in requests]
    failed: dict[int, ChildError] = {}
    for round_index in range(max((request.rounds for request in requests), default=0)):
        for i, request in enumerate(requests):
            if round_index >= request.rounds or i in failed:
                continue
            progress(request, round_index)
            try:
                measured[i].append(run(request, round_index))
            except ChildError as error:
                failed[i] = error
    return [failed.get(i) or combine(request, measured[i]) for i, request in enumerate(requests)]


def combine(request: Request, measurements: list[dict[str, Any]]) -> Result:
    """The result of a job, in the form that every host's results have, from the measurements of all its rounds."""
    if request.gpus:
        return result_of(request, measurements[0])
    first = min(measurements, key=lambda measurement: int(measurement["round"]))
    wall = [time for measurement in measurements for time in measurement["frames"]["wall"]]
    cpu = [time for measurement in measurements for time in measurement["frames"]["cpu"]]
    if len(cpu) != len(wall):
        cpu = []  # A host that could tell it in some rounds only would give a median of those.
    gpu = [time for measurement in measurements for time in measurement["frames"]["gpu"]]
    embree = [time for measurement in measurements for time in measurement["embree_cpu"]]
    timed = _rays_timed(request, first["rays"])
    frame = median(wall)
    interval = median_interval(wall)
    return {
        "scene": request.scene,
        "family": None,
        "triangles": first["triangles"],
        "device": first["device"],
        **request.variant.as_dict(),
        "sah": {
            "traversal": request.costs.traversal,
            "intersection": request.costs.intersection,
            "cost": first["cost"],
            "epo": first.get("epo"),
        },
        "depth": first["depth"],
        "size": list(request.size),
        "rays_kind": request.rays,
        "frames": len(wall),
        "frame_ms": {
            "median": frame * 1e3,
            "ci_low": None if interval is None else interval[0] * 1e3,
            "ci_high": None if interval is None else interval[1] * 1e3,
        },
        "frames_by_round": [len(measurement["frames"]["wall"]) for measurement in measurements],
        "rounds_started_at": [measurement["started_at"] for measurement in measurements],
        "frames_ms": [time * 1e3 for time in wall],
        "frames_cpu_ms": [time * 1e3 for time in cpu],
        "frames_gpu_ms": [None if time is None else time * 1e3 for time in gpu],
        "fps": 1 / frame,
        "mrays_per_s": timed / frame / 1e6,
        "mrays_per_cpu_s": timed / median(cpu) / 1e6 if cpu else None,
        "rays_timed": timed,
        "rays": first["rays"],
        "structure_bytes": first["structure_bytes"],
        "primitive_bytes": first["primitive_bytes"],
        "build_ms": first["build_ms"],
        "compile_ms": first["compile_s"] * 1e3,
        "phases_ms": _phases(measurements),
        "per_ray": _per_ray(first["per_ray"]),
        "overflows": 0,
        "answers_sha": first.get("answers_sha"),
        "error": {name: first["error"].get(name) for name in _ERRORS} | {"counts": first["error"]["counts"]},
        "vs_embree": _versus(timed, cpu, embree),
        "model": first.get("model"),
        "pictures": first.get("pictures"),
        "specialised": first["specialised"] if request.specialise else None,
        "samples": [measurement["samples"] for measurement in measurements if measurement["samples"]],
        "load_average": max(measurement["load_average"] for measurement in measurements),
        "versions": first["versions"],
        "started_at": first["started_at"],
    }


def _rays_timed(request: Request, rays: dict[str, int]) -> int:
    return (0 if request.rays == "shadow" else rays["primary"]) + (0 if request.rays == "primary" else rays["shadow"])


def _phases(measurements: list[dict[str, Any]]) -> dict[str, float] | None:
    """The milliseconds of each phase over all rounds; None where a round does not tell."""
    told = [measurement.get("phases_ms") for measurement in measurements]
    if not all(told):
        return None
    names = dict.fromkeys(name for phases in told if phases for name in phases)
    return {name: sum(phases.get(name, 0.0) for phases in told if phases) for name in names}


def _per_ray(counts: dict[str, float] | None) -> dict[str, float | None]:
    names = ("nodes", "inner", "leaves", "triangles", "bytes", "lines")
    return {name: None if counts is None else counts.get(name) for name in names}


def _versus(timed: int, cpu: list[float], embree: list[float]) -> dict[str, float | None]:
    """Embree over the same rays, frame against frame next to it."""
    if not embree or timed == 0:
        return {"mrays_per_cpu_s": None, "ratio": None}
    ratios = [theirs / ours for ours, theirs in zip(cpu, embree, strict=True)]
    return {"mrays_per_cpu_s": timed / median(embree) / 1e6, "ratio": median(ratios)}
