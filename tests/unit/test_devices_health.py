"""The verdict on a device: a right run passes, and every way to be wrong is named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from renderer.host import DeviceGoneError
from renderer.instrumented import records_of
from renderer.plan import PlanError
from renderer.prepare import Prepared, prepare
from renderer.records import Hits, Records
from renderer.twin_host import TwinHost
from server.devices import health
from server.devices.examined import Examined, examined_twin


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    return prepare(health.SCENE)


@pytest.fixture(scope="module")
def records(prepared: Prepared) -> Records:
    plan = prepared.plan(instrument=True)
    try:
        return records_of(prepared, plan, TwinHost(1).collect(plan))
    except PlanError as error:
        if "context" in str(error):
            pytest.skip(str(error))
        raise


def with_hits(records: Records, primitive: Any = None, t: Any = None) -> Records:
    hits = records.hits
    return replace(records, hits=Hits(hits.t if t is None else t, hits.primitive if primitive is None else primitive))


def test_the_twin_passes_and_its_records_are_the_golden_ones(prepared: Prepared, records: Records) -> None:
    found = health.verdict(prepared, records, {})
    assert (found["passed"], found["reason"]) == (True, None)
    assert found["identical"] == {"hits": True, "t": True}
    assert found["counts"]["primary"] == 64 * 64


def test_other_bits_of_t_are_told_and_pass(prepared: Prepared, records: Records) -> None:
    t = np.where(np.isfinite(records.hits.t), np.nextafter(records.hits.t, np.float32(0)), records.hits.t)
    found = health.verdict(prepared, with_hits(records, t=t.astype(np.float32)), {})
    assert found["passed"]
    assert found["identical"] == {"hits": True, "t": False}


@pytest.mark.parametrize("kind", ["false misses", "false hits", "wrong primitives", "wrong shadows", "not one ray hit"])
def test_wrong_rays_fail_and_are_counted(prepared: Prepared, records: Records, kind: str) -> None:
    primitive = records.hits.primitive.copy()
    hit, missed = np.flatnonzero(primitive >= 0), np.flatnonzero(primitive < 0)
    middle = hit[len(hit) // 2]
    wrong = records
    if kind == "false misses":
        primitive[middle] = -1
    elif kind == "false hits":
        primitive[missed[0]] = 0
    elif kind == "wrong primitives":
        primitive[middle] = (primitive[middle] + 7) % len(prepared.scene.faces)
    elif kind == "wrong shadows":
        wrong = replace(records, occluded=~records.occluded)
    else:
        primitive[:] = -1
    found = health.verdict(prepared, with_hits(wrong, primitive), {})
    assert not found["passed"]
    assert kind in found["reason"]
    assert found["identical"]["hits"] is False


@pytest.mark.parametrize(
    ("precision", "words"),
    [
        (
            {"fragment": {"add": {"cases": 64, "wrong": 9, "max_ulp": 2}}},
            "add in fragment shaders is off by up to 2 ulp",
        ),
        ({"compute": {"mul": {"max_ulp": 8192}}}, "mul in compute shaders"),
        ({"compute": {"div": {"max_ulp": 4}}}, "div in compute"),
        ({"fragment": {"mul_int": {"wrong": 1}}}, "mul_int of whole numbers is wrong in fragment shaders"),
    ],
)
def test_arithmetic_that_is_not_single_precision_fails(
    prepared: Prepared, records: Records, precision: dict[str, Any], words: str
) -> None:
    found = health.verdict(prepared, records, precision)
    assert not found["passed"]
    assert words in found["reason"]


def test_what_glsl_allows_passes(prepared: Prepared, records: Records) -> None:
    """Division within 2.5 ulp, contraction, flushed denormals, structs (no such value is in one), no fragment SSBO."""
    allowed = {
        "compute": {
            "add": {"max_ulp": 0},
            "div": {"max_ulp": 3},
            "mul_add": {"wrong": 64, "max_ulp": 10**9},
            "denormal": {"wrong": 64, "max_ulp": 4154990},
            "struct_float": {"wrong": 64, "max_ulp": 8192},
        },
        "fragment": {"error": "GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS is 0"},
    }
    assert health.verdict(prepared, records, allowed)["passed"]


class BrokenHost(TwinHost):
    def __init__(self, error: Exception) -> None:
        super().__init__(1)
        self.error = error

    def collect(self, plan: object) -> Any:
        raise self.error


def test_a_refusal_is_a_failure_with_its_facts_kept() -> None:
    said: list[str] = []
    device = Examined(BrokenHost(PlanError("The device hangs.")), lambda: {"name": "x"})
    assert health.check(device, said.append) == {
        "facts": {"name": "x"},
        "health": {"passed": False, "reason": "It failed its health check: The device hangs."},
    }
    assert [word for word in said if word != "waiting"] == ["preparing", "running"]


def test_a_device_that_goes_away_has_not_failed() -> None:
    device = Examined(BrokenHost(DeviceGoneError("gone")), dict)
    with pytest.raises(DeviceGoneError):
        health.check(device, lambda _: None)


def test_the_twin_says_what_it_is(records: Records) -> None:
    facts = examined_twin().facts()
    assert {"name", "driver", "gl", "limits"} <= facts.keys()
    assert facts["limits"]["COMPUTE_SHADER_STORAGE_BLOCKS"] >= 4
