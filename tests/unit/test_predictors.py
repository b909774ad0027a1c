"""Powers that were put into results are found again, and what foretells nothing says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from server.comparison.predictors import LEAST, predictors

SEED = 11


def results(count: int = 40) -> list[dict[str, Any]]:
    """Of two variants on one phone: time is a power of a sum of SAH cost and overlap, and of the work in part."""
    rng = np.random.default_rng(SEED)
    rows = []
    for number in range(count):
        cost, overlap = float(rng.uniform(20, 200)), float(rng.uniform(1, 60))
        seconds = (0.7 * cost + 0.3 * overlap) ** 0.8 * (1e-9 if number % 2 else 3e-9)
        rows.append(
            {
                "device_id": "P1",
                "rays_kind": "primary",
                "traversal": ("bvh-stack", "bvh-skip-link")[number % 2],
                "structure_bytes": 1000,
                "sah_cost": cost,
                "sah_epo": overlap,
                "per_ray_inner": cost * float(rng.uniform(0.8, 1.25)),
                "per_ray_triangles": 0.0,
                "per_ray_nodes": float(rng.uniform(1, 100)),
                "mrays_per_s": 1e-6 / seconds,
            }
        )
    return rows


def test_the_law_behind_results_is_found() -> None:
    (found,) = predictors(results())
    assert (found.device, found.rays) == ("P1", "primary")
    by_key = {one.key: one for one in found.predictors}
    assert [one.key for one in found.predictors] == sorted(by_key, key=lambda key: -by_key[key].explained)
    best = found.predictors[0]
    assert (best.key, best.results, best.variants) == ("overlap", 40, 2)
    assert best.weight == pytest.approx(0.3)
    assert best.explained == pytest.approx(1.0)
    assert best.exponent == pytest.approx(0.8)
    assert best.off_by == pytest.approx(1.0)
    assert best.across[0] < 0.9, "the two variants differ by a factor that one for all does not know"
    assert 0.5 < by_key["work"].explained < 0.99
    assert by_key["nodes"].explained < 0.2
    assert "bytes" not in by_key, "no result has them"
    x, y = np.log(np.array(best.points)).T
    np.testing.assert_allclose(y, 0.8 * x, atol=1e-9)


def test_too_few_trees_tell_nothing() -> None:
    assert predictors([]) == []
    assert predictors(results(2 * LEAST - 2)) == []
    same = [row | {"sah_cost": 50.0, "per_ray_inner": 9.0, "per_ray_nodes": 1.0} for row in results()]
    assert predictors(same) == []


def test_processor_time_is_taken_where_it_was_measured() -> None:
    rows = [row | {"mrays_per_cpu_s": row["mrays_per_s"], "mrays_per_s": 1.0} for row in results()]
    assert predictors(rows)[0].predictors[0].explained == pytest.approx(1.0)
