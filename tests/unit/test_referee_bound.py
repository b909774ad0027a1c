"""The bound on float32: no disagreement beyond it, and disagreements that come near it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from exact_cases import cast
from float32_tests import SHAPES, Found, aimed_at_edges, moller_trumbore, watertight

from renderer.judge import referee
from renderer.records import Floats, Rays

TESTS: dict[str, Callable[[Floats, Rays], Found]] = {"moller-trumbore": moller_trumbore, "watertight": watertight}


def worst(name: str, shape: str, seed: int, n: int = 50_000) -> tuple[int, float, float]:
    """Disagreements of float32 with the referee, and the worst edge and t error over their bounds."""
    triangles, asked = aimed_at_edges(np.random.default_rng(seed), shape, n)
    own = np.arange(n, dtype=np.int32)
    hit, t = TESTS[name](triangles, asked)
    margin, bound = (f(triangles, asked, own, name) for f in (referee.edge_margin, referee.t_bound))
    exact = referee.plane_t(triangles, asked, own)
    ahead = exact > bound
    differ = (hit != (margin >= 0)) & ahead
    sound = hit & (margin >= 0) & ahead
    error = np.abs(t - exact)[sound] / bound[sound]
    return int(differ.sum()), float(np.abs(margin[differ]).max()), float(error.max())


@pytest.mark.parametrize("seed", [41, 42])
@pytest.mark.parametrize("name", TESTS)
def test_float32_stays_within_the_bound_which_is_not_too_wide(name: str, seed: int) -> None:
    edges, times = [], []
    for shape in SHAPES:
        differ, edge, t = worst(name, shape, seed)
        print(f"{name}, {shape}, seed {seed}: {differ} disagree, worst edge {edge:.3f}, worst t {t:.3f} of the bound")
        assert differ > 1000
        assert edge <= 1
        assert t <= 1
        edges.append(edge)
        times.append(t)
    assert min(edges) >= 1 / 10
    assert max(edges) >= 1 / 5
    assert max(times) >= 1 / 5


@pytest.mark.parametrize("name", TESTS)
def test_grown_and_shrunk_triangles_are_what_float32_could_and_must_hit(name: str) -> None:
    triangles, asked = aimed_at_edges(np.random.default_rng(43), "even", 400)
    hit = TESTS[name](triangles, asked)[0]
    for i in range(400):
        could, must = (
            referee.any_hit(triangles[i : i + 1], asked[i : i + 1], None, g, None, name) for g in (1.0, -1.0)
        )
        assert must[0] <= hit[i] <= could[0]


@pytest.mark.parametrize("scale", [2.0**-40, 2.0**-70, 2.0**64, 2.0**100])
def test_where_float32_runs_out_of_range_it_may_answer_anything(scale: float) -> None:
    triangles, asked = aimed_at_edges(np.random.default_rng(44), "even", 20_000)
    triangles, asked = (triangles * np.float32(scale)), cast(asked.origin * np.float32(scale), asked.direction)
    own = np.arange(len(asked), dtype=np.int32)
    margin = referee.edge_margin(triangles, asked, own)
    lost = moller_trumbore(triangles, asked)[0] != (referee.plane_t(triangles, asked, own) > 0) & (margin >= 0)
    ahead = referee.plane_t(triangles, asked, own) > referee.t_bound(triangles, asked, own)
    assert (np.abs(margin[lost & ahead]) <= 1).all()
    assert (np.abs(margin[lost & np.isinf(referee.t_bound(triangles, asked, own))]) <= 1).all()


def test_the_bound_of_an_unknown_test_is_the_wider_one() -> None:
    triangles, asked = aimed_at_edges(np.random.default_rng(45), "even", 1000)
    own = np.arange(1000, dtype=np.int32)
    margins = [referee.edge_margin(triangles, asked, own, name) for name in (*TESTS, "another")]
    assert (np.abs(margins[2]) == np.minimum(np.abs(margins[0]), np.abs(margins[1]))).all()
    bounds = [referee.t_bound(triangles, asked, own, name) for name in (*TESTS, "another")]
    assert (bounds[2] == np.maximum(bounds[0], bounds[1])).all()
