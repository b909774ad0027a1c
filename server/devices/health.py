"""A device's health: a known scene judged ray by ray, and how exactly it computes (`python -m server.devices.health`).

It passes when the referee finds no false hit, false miss, wrong primitive or wrong shadow beyond what float32 cannot
tell (docs/method.md, Error), and when its arithmetic keeps to GLSL ES 3.10, section 4.7.1. Whether its records are the
twin's, bit for bit, is told and decides nothing: a GPU may contract and reorder.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.answering import Say, answer_task
from renderer.instrumented import records_of
from renderer.judge.accuracy import Errors, judge
from renderer.locks import holding, machine_lock
from renderer.plan import PlanError
from renderer.prepare import Prepared, prepare
from renderer.records import Records
from renderer.request import Request
from renderer.variant import Variant
from server.devices.examined import Examined, examined_phone, examined_twin
from server.devices.registry import TWIN

Json = dict[str, Any]

SCENE = Request("cornell-box", Variant(method="compute"), size=(64, 64), frames=1, rounds=1)
"""The known scene: compute, which every device must offer."""
GOLDEN = {
    "hits": "d283cfa90ee99065534ddd302685b57c279d7dd35e364a5047fec3053139bfd0",
    "t": "e0beba825b883c20178f74f79be3901eb28042139c2ab7a09fc80eebf0620489",
}
"""Of the twin on llvmpipe: sha256 of what was hit and shadowed, and of the bits of t."""
MAX_ULP = {"add": 1, "mul": 1, "div": 3}
"""The largest errors that pass, in units in the last place: a neighbour of the right answer; 2.5 for division."""
EXACT = ("min_int", "max_int", "mul_int")
_WRONG = {
    "false_hit": "false hits",
    "false_miss": "false misses",
    "wrong_primitive": "wrong primitives",
    "shadow_mismatch": "wrong shadows",
}


def check(device: Examined, say: Say) -> Json:
    """The device's facts, and its health: `passed`, the `reason` if not, and the figures behind it.

    Raise DeviceGoneError when it goes away, which says nothing about its health.
    """
    with holding(machine_lock(), lambda: say("waiting")):
        say("preparing")
        prepared = prepare(SCENE)
        plan = prepared.plan(instrument=True)
    with holding(device.host.lock, lambda: say("waiting")):
        say("running")
        facts: Json = {}
        try:
            facts = device.facts()
            records = records_of(prepared, plan, device.host.collect(plan))
        except PlanError as error:
            return {"facts": facts, "health": {"passed": False, "reason": f"It failed its health check: {error}"}}
    with holding(machine_lock(), lambda: say("waiting")):
        say("judging")
        return {"facts": facts, "health": verdict(prepared, records, facts.get("precision") or {})}


def verdict(prepared: Prepared, records: Records, precision: Mapping[str, Any]) -> Json:
    """The health that a run of SCENE and a precision probe add up to."""
    tree = prepared.referee_tree()
    errors = judge(prepared.scene.triangles, records, None, tree, "referee")
    reasons = [*_wrong_rays(errors), *_wrong_sums(precision)]
    width, height = SCENE.size
    return {
        "passed": not reasons,
        "reason": f"It failed its health check: {'; '.join(reasons)}." if reasons else None,
        "scene": SCENE.scene,
        "variant": SCENE.variant.label,
        "size": [width, height],
        "counts": errors.counts,
        "t_ulp_max": errors.t_ulp_max,
        "identical": {name: found == GOLDEN[name] for name, found in digests(records).items()},
    }


def digests(records: Records) -> dict[str, str]:
    """sha256 of what primary and shadow rays found, and of the bits of t."""
    hits, shadow = records.hits, (records.shadow_pixel, records.shadow_light, records.occluded)
    return {"hits": _digest(hits.primitive, *shadow), "t": _digest(hits.t)}


def _wrong_rays(errors: Errors) -> list[str]:
    """What is wrong, in numbers of rays."""
    counts = {name: errors.counts[name] for name in _WRONG}
    if not errors.counts["hits"]:
        return ["not one ray hit anything"]
    return [f"{counts[name]} {words} in {SCENE.scene}" for name, words in _WRONG.items() if counts[name]]


def _wrong_sums(precision: Mapping[str, Any]) -> list[str]:
    """What a probe's arithmetic has wrong, by stage; a stage that did not run says nothing."""
    reasons = []
    for stage, found in precision.items():
        operations = {name: figures for name, figures in found.items() if name != "error"}
        for name, allowed in MAX_ULP.items():
            ulp = operations.get(name, {}).get("max_ulp") or 0
            if ulp > allowed:
                reasons.append(f"{name} in {stage} shaders is off by up to {ulp} ulp, {allowed} is allowed")
        for name in EXACT:
            if operations.get(name, {}).get("wrong"):
                reasons.append(f"{name} of whole numbers is wrong in {stage} shaders")
    return reasons


def _digest(*arrays: npt.NDArray[Any]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _work(task: Json, say: Say) -> Json:
    try:
        device = examined_twin() if task["kind"] == TWIN else examined_phone(task["id"])
    except PlanError as error:
        return {"unable": str(error)}
    return check(device, say)


if __name__ == "__main__":
    answer_task(_work)
