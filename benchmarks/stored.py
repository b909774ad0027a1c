"""Fills a database with made-up results as big and as varied as measured ones, for `benchmarks.pages`."""

from __future__ import annotations

import random
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from itertools import product
from typing import Any

from sqlalchemy import Table, insert
from sqlalchemy.orm import Session

from renderer.request import Request
from renderer.variant import AXES, TRAVERSALS, Variant, refusal
from server.devices.registry import PHONE, TWIN
from server.store.database import Database
from server.store.models import Base, Change, Device, Job, Result, Slice, Study
from server.store.records import result_columns
from server.store.setups import digest_of, facts_of, require_setup

SCENES = (
    *("cornell-box", "crytek-sponza", "conference", "forest", "cornell-buddha", "happy-buddha"),
    *("suzanne", "bunny", "dragon", "sibenik", "hairball", "living-room"),
)
PHONES = ("R58M12ABCDE", "1A2B3C4D5E", "192.0.2.17:5555", "emulator-5554")
DEVICES = ("llvmpipe", "llvmpipe@second", *PHONES)
SIZES = ((256, 256), (1024, 1024))
VERSIONS = ("0.1.0", "0.2.0", "0.3.0")
FRAMES, ROUNDS = 27, 3
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
CHUNK = 2000
Json = dict[str, Any]


def matrix() -> list[tuple[Request, str]]:
    """Every configuration of one study: the paper's axes over all scenes and devices, one size."""
    variants = [
        Variant(traversal, method, layout)
        for traversal, method, layout in product(TRAVERSALS, AXES["method"], AXES["layout"])
        if TRAVERSALS[traversal].structure != "none"
    ]
    variants = [variant for variant in variants if refusal(variant) is None]
    return [
        (Request(scene, variant, SIZES[0], frames=FRAMES, rounds=ROUNDS), device)
        for scene, device, variant in product(SCENES, DEVICES, variants)
    ]


def document(request: Request, device: str, size: tuple[int, int], version: str, draw: random.Random) -> Json:
    """A result with all raw frames, as `renderer.bench.combine` writes it."""
    rays = {"primary": size[0] * size[1], "shadow": int(size[0] * size[1] * 0.8)}
    frames = [draw.lognormvariate(3.0, 0.1) for _ in range(FRAMES)]
    middle = sorted(frames)
    speed = sum(rays.values()) / middle[FRAMES // 2] / 1e3
    nodes = draw.uniform(20, 90)
    phone = device in PHONES
    counts = ("hits", "false_hit", "false_miss", "wrong_primitive", "edge", "embree_wrong", "shadow", "shadow_mismatch")
    return {
        "scene": request.scene,
        "family": None,
        "triangles": 1000 + 977 * SCENES.index(request.scene),
        "device": {
            "id": device,
            "kind": PHONE if phone else TWIN,
            "name": f"Phone {device}" if phone else "llvmpipe (LLVM 15.0.6, 256 bits)",
            "driver": "OpenGL ES 3.2 V@0502.0" if phone else "4.5 (Core Profile) Mesa 22.3.6",
            "vendor": "Qualcomm" if phone else "Mesa/X.org",
            "threads": None if phone else 1,
        },
        **request.variant.as_dict(),
        "sah": {"traversal": 3.0, "intersection": 1.5, "cost": draw.uniform(20, 200)},
        "depth": 24,
        "size": list(size),
        "rays_kind": "both",
        "frames": FRAMES,
        "frame_ms": {"median": middle[FRAMES // 2], "ci_low": middle[8], "ci_high": middle[18]},
        "frames_ms": frames,
        "frames_cpu_ms": [frame * 0.97 for frame in frames],
        "frames_gpu_ms": [frame * 0.9 for frame in frames] if phone else [],
        "fps": 1e3 / middle[FRAMES // 2],
        "mrays_per_s": speed,
        "mrays_per_cpu_s": speed / 0.97,
        "rays_timed": sum(rays.values()),
        "rays": rays,
        "structure_bytes": 448 * draw.randint(1, 9999),
        "primitive_bytes": 48 * draw.randint(1, 99999),
        "build_ms": draw.uniform(1, 900),
        "compile_ms": draw.uniform(5, 90),
        "per_ray": {
            "nodes": nodes,
            "inner": nodes * 0.8,
            "leaves": nodes * 0.2,
            "triangles": draw.uniform(2, 30),
            "bytes": nodes * 64,
            "lines": None,
        },
        "overflows": 0,
        "error": {
            **dict.fromkeys(("false_hit", "wrong_primitive", "shadow_mismatch", "shadow_edge"), 0.0),
            "false_miss": draw.uniform(0, 1e-5),
            "edge": draw.uniform(0, 1e-4),
            "t_rel_p99": 1.769e-07,
            "t_rel_max": 2.444e-07,
            "t_ulp_max": 4.029,
            "raster_mismatch": None,
            "flip": None,
            "counts": {name: draw.randint(0, 99999) for name in counts},
        },
        "vs_embree": {"mrays_per_cpu_s": speed * 2, "ratio": 0.5 / 0.97},
        "specialised": ["vertex normals in the primitive buffers", "60 of 64 stack entries"],
        "samples": [_samples(draw) for _ in range(ROUNDS)] if phone else [],
        "load_average": draw.uniform(0, 2),
        "versions": {
            "rayfarm": version,
            "shader_sha": sha256(f"{request.variant.label} {version}".encode()).hexdigest(),
            "plan": 1,
            "embreex": "4.4.0.post1",
        },
        "started_at": "2026-01-01T00:00:00+00:00",
    }


def fill(database: Database, results: int, seed: int = 1) -> int:
    """Add studies until there are so many results; return how many studies. The same seed gives the same database."""
    draw = random.Random(seed)
    orders = matrix()
    study = made = 0
    setups: dict[str, int] = {}
    with database.writing() as session:
        session.execute(insert(Device), [_device(name) for name in DEVICES])
    while made < results:
        study += 1
        taken = _part(orders, study)[: results - made]
        with database.writing() as session:
            session.execute(insert(Study), [_study(study)])
            for first in range(0, len(taken), CHUNK):
                _add(session, study, made + first, taken[first : first + CHUNK], draw, setups)
        made += len(taken)
    return study


def _part(orders: list[tuple[Request, str]], study: int) -> list[tuple[Request, str]]:
    """A study's configurations: one device's share, in turn, so that studies have some hundred jobs."""
    device = DEVICES[study % len(DEVICES)]
    return [order for order in orders if order[1] == device]


def _add(
    session: Session,
    study: int,
    first: int,
    orders: list[tuple[Request, str]],
    draw: random.Random,
    setups: dict[str, int],
) -> None:
    rows: dict[type[Base], list[Json]] = {Job: [], Slice: [], Change: [], Result: []}
    size = SIZES[study % len(SIZES)]
    version = VERSIONS[study // len(DEVICES) % len(VERSIONS)]
    for number, (request, device) in enumerate(orders, first + 1):
        at = BEGIN + timedelta(minutes=number)
        rows[Job].append(_job(number, study, request, device, at))
        rows[Slice] += [{"job_id": number, "round": index, "state": "done", "attempts": 1} for index in range(ROUNDS)]
        rows[Change] += [{"job_id": number, "state": state, "at": at} for state in ("queued", "running", "done")]
        made = document(request, device, size, version, draw)
        setup = _setup(session, setups, made)
        known = {"id": number, "job_id": number, "study_id": study, "setup_id": setup, "recorded_at": at}
        rows[Result].append(known | result_columns(made))
    for model, values in rows.items():
        assert isinstance(model.__table__, Table)
        session.execute(insert(model.__table__), values)


def _setup(session: Session, known: dict[str, int], made: Json) -> int:
    facts = facts_of(made)
    digest = digest_of(facts)
    if digest not in known:
        known[digest] = require_setup(session, facts)
    return known[digest]


def _job(number: int, study: int, request: Request, device: str, at: datetime) -> Json:
    return {
        "id": number,
        "study_id": study,
        "scene": request.scene,
        "label": request.variant.label,
        "request": request.to_json(),
        "device": device,
        "priority": 100,
        "state": "done",
        "created_at": at,
        "started_at": at,
        "finished_at": at,
    }


def _study(number: int) -> Json:
    return {"id": number, "name": f"night {number}", "request": {"name": "night"}, "refused": [], "created_at": BEGIN}


def _device(name: str) -> Json:
    kind = PHONE if name in PHONES else TWIN
    return {"id": name, "kind": kind, "host": "here", "presence": "offline", "facts": {"name": name}}


def _samples(draw: random.Random) -> Json:
    return {
        "temperature_c": [round(draw.uniform(30, 45), 1) for _ in range(20)],
        "clock_mhz": [draw.randint(300, 900) for _ in range(20)],
    }
