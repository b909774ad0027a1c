"""One slice: one round of one job, measured in a process of its own (`python -m renderer.slice`).

`renderer.answering` says how the request goes in and the measurement comes out.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from renderer.answering import Say, answer_task, silent, tell_note
from renderer.host import Host
from renderer.instrumented import records_of, refuse_cut
from renderer.judge.timed_image import refuse_apart
from renderer.locks import holding, machine_lock
from renderer.phases import Phases, process_age_s
from renderer.pictures.counts import METRICS, Counts, count_pixels
from renderer.plan import VERSION, Plan
from renderer.planner import in_passes
from renderer.prepare import Prepared, prepare, prepare_again
from renderer.records import COUNTERS, Records
from renderer.request import Request
from renderer.twin_host import TwinHost

# Judging takes the referee's compiler and Embree, drawing takes an image library; most rounds do neither.
if TYPE_CHECKING:
    from renderer.judge.accuracy import Errors
    from renderer.judge.oracle import Oracle

Measurement = dict[str, Any]


def measure(
    request: Request,
    round_index: int,
    host: Host,
    say: Say = silent,
    pictures: Path | None = None,
    *,
    fresh: bool = False,
    note: Say = silent,
) -> Measurement:
    """Measure one round on `host`: counters and errors in the first round, frame times in each.

    `say` is told each phase: `waiting` for a lock, `preparing`, `running`, `judging`. Our own heavy work holds this
    machine's lock, the run holds the device's. The first round's pictures go into the folder `pictures`.
    `fresh` tells that this process was started for this round: its start counts then. `note` hears how far a long
    build is.
    """
    starting_s = process_age_s() if fresh else None
    started = datetime.now(UTC).isoformat(timespec="seconds")
    phases = Phases()
    with _phase("preparing", machine_lock(), say, phases):
        ready = _make_ready(request, round_index, host, phases, note)
    with _phase("running", host.lock, say, phases):
        device = host.device()
        with phases.timed("collecting"):
            records = _records(ready, host)
        against = _against(ready, records)
        embree: list[float] = []
        if against is not None:
            against()
        with phases.timed("measuring"):
            timed = host.measure(
                ready.timed,
                _frames_of(request, round_index),
                lambda: embree.append(against()) if against is not None else None,
            )
        phases.add("compiling", timed.compile_s)
        phases.add("measuring", -timed.compile_s)
        refuse_cut(int((timed.image[..., 3] == 0).sum()))
    measurement: Measurement = {
        "round": round_index,
        "started_at": started,
        "device": device,
        "frames": asdict(timed.frames),
        "samples": timed.samples,
        "embree_cpu": embree,
        "compile_s": timed.compile_s,
        "load_average": os.getloadavg()[0],
    }
    if round_index == 0:
        assert records is not None
        with _phase("judging", machine_lock(), say, phases):
            with phases.timed("judging"):
                refuse_apart(ready.prepared.scene, records, request.rays, timed.image)
                errors = asdict(_judged(ready, records, timed.image))
                measurement |= _facts(ready.prepared, ready.timed, records) | {"error": errors}
                if request.models:
                    _add_models(measurement, ready, records, host)
            if pictures is not None:
                with phases.timed("pictures"):
                    from renderer.pictures.files import write_pictures

                    counts = _counts(ready.prepared, records)
                    measurement["pictures"] = write_pictures(pictures, timed.image, counts)
    return measurement | {"phases_ms": phases.total(starting_s)}


@dataclass(frozen=True, eq=False)
class _Ready:
    """What one round needs before a device is touched; the instrumented plan only where its records are wanted."""

    prepared: Prepared
    timed: Plan
    instrumented: Plan | None
    oracle: Oracle | None


def _make_ready(request: Request, round_index: int, host: Host, phases: Phases, note: Say) -> _Ready:
    with phases.timed("preparing"):
        prepared = prepare_again(request, note) if request.rounds > 1 else prepare(request, note=note)
    first, paced = round_index == 0, request.vs_embree and host.paces
    oracle = None
    if paced or (first and request.check != "none"):
        with phases.timed("judging"):
            from renderer.judge.oracle import Oracle

            oracle = Oracle(prepared.scene.vertices, prepared.scene.faces)
    with phases.timed("preparing"):
        instrumented = prepared.plan(instrument=True) if first or paced else None
        return _Ready(prepared, prepared.plan(instrument=False), instrumented, oracle)


def _records(ready: _Ready, host: Host) -> Records | None:
    if ready.instrumented is None:
        return None
    return records_of(ready.prepared, ready.instrumented, host.collect(ready.instrumented))


def _against(ready: _Ready, records: Records | None) -> Callable[[], float] | None:
    request = ready.prepared.request
    if not request.vs_embree or ready.oracle is None or records is None:
        return None
    return _embree_frame(request, ready.oracle, records)


def _judged(ready: _Ready, records: Records, image: npt.NDArray[np.uint8]) -> Errors:
    from renderer.judge.accuracy import judge

    prepared, request = ready.prepared, ready.prepared.request
    tree = prepared.referee_tree() if request.check in ("referee", "image") else None
    scene = prepared.scene
    intersector = request.variant.intersector
    errors = judge(scene.triangles, records, ready.oracle, tree, request.check, intersector, scene.lights)
    if request.check != "image":
        return errors
    assert tree is not None
    from renderer.judge.image_error import image_error
    from renderer.judge.truth_image import truth_image

    away = image_error(image, truth_image(scene, tree, request.size, request.camera, request.rays))
    return replace(errors, flip=away.flip, psnr=away.psnr)


def _add_models(measurement: Measurement, ready: _Ready, records: Records, host: Host) -> None:
    from renderer.models import run_models

    lines, measurement["model"] = run_models(ready.prepared, ready.timed, records, host)
    if measurement["per_ray"] is not None:
        measurement["per_ray"]["lines"] = lines


@contextmanager
def _phase(name: str, lock: Path, say: Say, phases: Phases) -> Iterator[None]:
    begun = time.perf_counter()
    with holding(lock, lambda: say("waiting")):
        phases.wait(time.perf_counter() - begun)
        say(name)
        yield


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
    from importlib.metadata import version

    from renderer.judge.accuracy import answers_sha

    tree = prepared.tree
    return {
        "triangles": len(prepared.scene.faces),
        "cost": None if tree is None else tree.cost,
        "epo": None if tree is None else tree.epo,
        "depth": None if tree is None else tree.depth,
        "build_ms": prepared.build_ms,
        "structure_bytes": prepared.packed.structure_bytes,
        "primitive_bytes": prepared.packed.primitives.nbytes,
        "rays": {"primary": 0 if records.rasterised else len(records.primary), "shadow": len(records.shadow)},
        "per_ray": _per_ray(prepared, records),
        "answers_sha": answers_sha(records),
        "specialised": list(plan.left_out),
        "versions": {
            "rayfarm": version("rayfarm"),
            "shader_sha": plan.shader_sha,
            "plan": VERSION,
            "embreex": version("embreex"),
        },
    }


def _per_ray(prepared: Prepared, records: Records) -> dict[str, float | None] | None:
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


def _counts(prepared: Prepared, records: Records) -> dict[str, Counts] | None:
    """What each pixel's rays fetched; None where brute force ran in passes, which do not carry counters."""
    if in_passes(prepared.scene, prepared.tree):
        return None
    return {metric: count_pixels(records, "both", metric) for metric in METRICS}


def pictures_of(task: dict[str, Any]) -> Path | None:
    """The folder for pictures that a slice's task names."""
    return Path(task["pictures"]) if task.get("pictures") else None


def _work(task: dict[str, Any], say: Say) -> Measurement:
    request = Request.from_json(task["request"])
    host = TwinHost(request.threads)
    return measure(request, task["round"], host, say, pictures_of(task), fresh=True, note=tell_note)


if __name__ == "__main__":
    answer_task(_work)
