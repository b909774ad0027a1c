"""The Pareto front against its definition, and where there is none."""

from __future__ import annotations

import random
from typing import Any

import pytest

from server.comparison.flat import Stored
from server.comparison.metrics import METRICS
from server.comparison.pareto import front, fronts
from server.comparison.pivot import compare

Point = tuple[float, float]


def dominates(one: Point, other: Point) -> bool:
    return one != other and one[0] <= other[0] and one[1] >= other[1]


@pytest.mark.parametrize("seed", range(40))
def test_the_front_is_what_nothing_dominates(seed: int) -> None:
    draw = random.Random(seed)
    # Few values, so that points often share one or both.
    points = [(draw.randrange(6) / 4, draw.randrange(6) / 2) for _ in range(draw.randrange(25))]
    wanted = {i for i, point in enumerate(points) if not any(dominates(other, point) for other in points)}
    found = front(points)
    assert set(found) == wanted
    assert len(found) == len(wanted)
    assert [points[i] for i in found] == sorted(points[i] for i in found)


def stored(job: int, traversal: str, speed: float | None, miss: float, **extra: Any) -> Stored:
    error = {"false_hit": 0.0, "false_miss": miss, "wrong_primitive": 0.0}
    known = {"scene": "a", "size": [8, 8], "rays_kind": "both", "structure_bytes": 100 * job}
    return Stored(job, None, "", known | {"traversal": traversal, "mrays_per_s": speed, "error": error} | extra)


def test_a_column_has_its_front_and_an_unmeasured_figure_no_point() -> None:
    results = [
        stored(1, "brute-force", 1.0, 0.0),
        stored(2, "bvh-stack", 3.0, 0.0),
        stored(3, "kd-backtrack", 4.0, 1e-5),
        stored(4, "kd-push-down", None, 0.0),
    ]
    table = compare(results, METRICS["fps"])
    names = [key[0] for key in table.row_keys]
    error, size = fronts(table, "error")[0], fronts(table, "size")[0]
    assert error is not None
    assert size is not None
    assert [names[place] for place in error] == ["bvh-stack", "kd-backtrack"]
    assert [names[place] for place in size] == ["brute-force", "bvh-stack", "kd-backtrack"]


def test_less_of_what_is_better_high_is_a_cost() -> None:
    results = [
        stored(1, "bvh-stack", 1.0, 0.0, error={"psnr": 60.0, "flip": 0.01}),
        stored(2, "kd-backtrack", 2.0, 0.0, error={"psnr": 40.0, "flip": 0.02}),
        stored(3, "kd-push-down", 1.5, 0.0, error={"psnr": 30.0, "flip": 0.03}),
    ]
    table = compare(results, METRICS["fps"])
    names = [key[0] for key in table.row_keys]
    for cost in ("psnr", "flip"):
        found = fronts(table, cost)[0]
        assert found is not None
        assert [names[place] for place in found] == ["bvh-stack", "kd-backtrack"]


@pytest.mark.parametrize("other", [{"scene": "b"}, {"size": [16, 8]}, {"rays_kind": "primary"}])
def test_variants_of_different_rays_have_no_front(other: dict[str, Any]) -> None:
    results = [stored(1, "bvh-stack", 1.0, 0.0), stored(2, "kd-backtrack", 2.0, 0.0, **other)]
    assert fronts(compare(results, METRICS["fps"], columns=("method",)), "error") == [None]
