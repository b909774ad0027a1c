"""Results from measurements: what a host could not tell in every round is not told."""

from __future__ import annotations

from typing import Any

import pytest

from renderer.bench import combine
from renderer.request import Request


def measurement(index: int, cpu: list[float]) -> dict[str, Any]:
    """One round of two frames of 10 ms as a slice measures it; the first carries the facts."""
    error = dict.fromkeys(
        ("false_hit", "false_miss", "edge", "wrong_primitive", "t_rel_p99", "t_rel_max", "t_ulp_max"), 0.0
    )
    error |= dict.fromkeys(("shadow_mismatch", "shadow_edge", "raster_mismatch", "flip", "counts"), 0.0)
    facts = {
        "triangles": 1,
        "cost": 1.0,
        "epo": 0.5,
        "depth": 1,
        "build_ms": 1.0,
        "structure_bytes": 1,
        "primitive_bytes": 1,
    }
    return {
        **facts,
        "round": index,
        "frames": {"wall": [0.01, 0.01], "cpu": cpu, "gpu": []},
        "samples": None,
        "embree_cpu": [],
        "compile_s": 0.1,
        "load_average": 0.0,
        "rays": {"primary": 1000, "shadow": 500},
        "per_ray": None,
        "error": error,
        "specialised": [],
        "versions": {},
        "device": {"id": "phone"},
        "started_at": "2026-01-01T00:00:00+00:00",
    }


@pytest.mark.parametrize(
    ("rounds", "speed"),
    [([[0.02, 0.02], [0.02, 0.02]], 0.075), ([[0.02, 0.02], []], None), ([[], []], None)],
)
def test_processor_times_of_some_rounds_only_are_not_told(rounds: list[list[float]], speed: float | None) -> None:
    request = Request("cornell-box", frames=4, rounds=2)
    result = combine(request, [measurement(index, cpu) for index, cpu in enumerate(rounds)])
    assert result["mrays_per_cpu_s"] == (None if speed is None else pytest.approx(speed))
    assert len(result["frames_cpu_ms"]) in (0, result["frames"])
    assert result["mrays_per_s"] == pytest.approx(0.15)
    assert result["frames_by_round"] == [2] * len(rounds)
