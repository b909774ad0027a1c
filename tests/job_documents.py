"""Jobs with whole results for tests of their pages: one as the twin gives it, one as a phone does."""

from __future__ import annotations

from typing import Any

from renderer.bench import combine
from renderer.request import Request
from renderer.variant import Variant
from server.devices.counters import samples_of
from server.store.database import Database
from server.store.models import now
from server.store.records import Order, add_jobs, add_result, change_state

Json = dict[str, Any]
FRAMES, ROUNDS = 24, 3
CLOCK = "/sys/class/kgsl/kgsl-3d0/gpuclk"
HEAT = "/sys/class/thermal/thermal_zone7/temp"
ERRORS: Json = {
    **dict.fromkeys(("false_hit", "false_miss", "wrong_primitive", "shadow_mismatch", "shadow_edge"), 0.0),
    **{"edge": 1e-4, "t_rel_p99": 1e-7, "t_rel_max": 1e-6, "t_ulp_max": 3.0, "raster_mismatch": None, "flip": None},
    "counts": {"primary": 4096, "hits": 3660, "false_hit": 0, "false_miss": 0, "wrong_primitive": 0, "edge": 0},
}


def measurement(round_index: int, samples: Json | None, gpu: bool) -> Json:
    """One round in the form of `renderer.slice`, its frames slower as it goes on."""
    wall = [(10 + round_index + 0.25 * i) / 1e3 for i in range(FRAMES // ROUNDS)]
    return {
        "round": round_index,
        "started_at": f"2026-01-01T00:00:{10 + round_index:02}+00:00",
        "device": {
            "id": "P1" if gpu else "llvmpipe",
            "kind": "agent" if gpu else "twin",
            "name": "x",
            "driver": "ES 3.1",
        },
        "frames": {
            "wall": wall,
            "cpu": [] if gpu else wall,
            "gpu": [None, *(0.9 * time for time in wall[1:])] if gpu else [],
        },
        "samples": samples,
        "embree_cpu": [],
        "compile_s": 0.5,
        "load_average": 0.75,
        **dict.fromkeys(("triangles", "depth", "structure_bytes", "primitive_bytes"), 36),
        **{"cost": 28.5, "epo": 3.5, "build_ms": 0.5, "rays": {"primary": 4096, "shadow": 3660}, "error": ERRORS},
        "per_ray": {"nodes": 8.0, "inner": 3.5, "leaves": 1.25, "triangles": 9.5, "bytes": 626.0},
        "specialised": ["vertex normals", "60 of 64 stack entries"],
        "versions": {"rayfarm": "0.1.0", "shader_sha": "ab" * 32, "plan": 1, "embreex": "4.4.0"},
    }


def phone_samples(round_index: int) -> Json:
    """What a phone tells beside a round: it warms up, its clock falls, and it throttles in the last one."""
    count, hot = FRAMES // ROUNDS, round_index == ROUNDS - 1
    values: Json = {
        "gpu_temp": {"values": [str(41_000 + 3_000 * round_index + 250 * i) for i in range(count)]},
        "gpu_clock": {"values": ["421000000" if hot else "585000000"] * count},
        "gpu_busy": {"values": ["97 %"] * (count - 1) + [None]},
    }
    status = {"battery": {"level": 80}, "thermal_status": 2 if hot else 0}
    files = {"gpu_temp": HEAT, "gpu_clock": CLOCK, "gpu_busy": "/sys/busy"}
    return samples_of(files, {"skin_temp": "no such file, or the shell may not read it"}, values, {}, status, status)


def request_of(scene: str = "forest") -> Request:
    """What the jobs ask for."""
    return Request(scene, Variant("bvh-stack"), size=(64, 64), frames=FRAMES, rounds=ROUNDS)


def document_of(*, phone: bool) -> Json:
    """A whole result, as `renderer.bench.combine` makes it."""
    measured = [measurement(i, phone_samples(i) if phone else None, phone) for i in range(ROUNDS)]
    return combine(request_of(), measured)


def add_measured(database: Database, *, phone: bool, scene: str = "forest", study: int | None = None) -> int:
    """A done job with such a result, its history as a worker writes it; its id."""
    request = request_of(scene)
    with database.writing() as session:
        slices = add_jobs(session, [Order(request)], study_id=study)
        job = slices[0].job
        for part in slices:
            reason = f"Round {part.round + 1} of {ROUNDS} on {job.device}."
            for state in ("preparing", "running", *(("judging",) if part.round == 0 else ())):
                change_state(session, job, state, reason)
                session.flush()
            part.state, part.attempts, part.measurement = "done", 1, {}
        add_result(session, job, document_of(phone=phone) | {"scene": scene})
        change_state(session, job, "done")
        job.started_at = job.finished_at = now()
        return job.id
