"""Phases: what is timed adds up to the time that passed, waiting left out."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from renderer.bench import combine, run_slice
from renderer.phases import HARNESS, WORK, Phases, process_age_s
from renderer.request import Request


def test_what_is_in_no_phase_is_other_and_waiting_is_nowhere() -> None:
    phases = Phases()
    with phases.timed("judging"):
        time.sleep(0.02)
    phases.add("judging", 0.001)
    begun = time.perf_counter()
    time.sleep(0.05)
    phases.wait(time.perf_counter() - begun)
    time.sleep(0.01)
    found = phases.total(0.5)
    assert found["starting"] == 500
    assert found["judging"] >= 21
    assert 9 <= found["other"] < found["judging"] + 50
    assert "starting" not in Phases().total()


def test_the_age_of_a_process_is_that_since_its_start() -> None:
    program = "import time; time.sleep(0.3); from renderer.phases import process_age_s; print(process_age_s())"
    begun = time.monotonic()
    told = float(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout)
    assert 0.28 <= told <= time.monotonic() - begun + 0.02


def test_a_result_tells_its_phases_over_all_rounds() -> None:
    request = Request("cornell-box", size=(16, 16), frames=2, rounds=2)
    measured = [run_slice(request, index) for index in range(2)]
    phases = combine(request, measured)["phases_ms"]
    assert set(phases) == {*WORK, *HARNESS} - {"pictures"}
    assert all(value >= 0 for value in phases.values())
    for name in ("starting", "compiling", "measuring"):
        assert phases[name] == pytest.approx(sum(one["phases_ms"][name] for one in measured))
    assert "judging" not in measured[1]["phases_ms"] or measured[1]["phases_ms"]["judging"] == 0
    assert combine(request, [measured[0], {**measured[1], "phases_ms": None}])["phases_ms"] is None
    assert process_age_s() is not None
