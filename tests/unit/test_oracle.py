"""The oracle: embreex's interval, units and limits, as the judge relies on them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from renderer.judge.oracle import Oracle
from renderer.records import Floats, Rays

INF = np.float32(np.inf)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
STACK = np.stack([CORNERS + np.array([0, 0, z], np.float32) for z in (1, 2)])


def rays(origin: object, direction: object, reach: object = INF) -> Rays:
    o, d = np.broadcast_arrays(np.array(origin, np.float32, ndmin=2), np.array(direction, np.float32, ndmin=2))
    return Rays(o.copy(), d.copy(), np.broadcast_to(np.array(reach, np.float32), len(o)).copy())


def nearly(t: list[float]) -> Any:
    """Embree divides by a processor's own approximation and one step of Newton's, so an ulp is the processor's."""
    return pytest.approx(t, rel=float(np.finfo(np.float32).eps))


@pytest.fixture(scope="module")
def oracle() -> Oracle:
    return Oracle(STACK)


def test_the_nearest_of_two_with_t_in_units_of_the_direction(oracle: Oracle) -> None:
    hits = oracle.closest(rays([0.2, 0.2, 0], [[0, 0, 1], [0, 0, 0.5], [0, 0, 4], [0, 0, -1]]))
    assert hits.t.tolist() == nearly([1, 2, 0.25, np.inf])
    assert hits.primitive.tolist() == [0, 0, 0, -1]
    assert hits.t.dtype == np.float32
    assert hits.primitive.dtype == np.int32


def test_both_sides_are_hit(oracle: Oracle) -> None:
    hits = oracle.closest(rays([0.2, 0.2, 3], [0, 0, -1]))
    assert (hits.t.tolist(), hits.primitive.tolist()) == (nearly([1]), [1])


def test_reach_is_the_last_t_that_counts_and_is_left_as_it_was(oracle: Oracle) -> None:
    reach = np.array([1 - 1e-6, 1 + 1e-6, 5], np.float32)
    asked = rays([[0.2, 0.2, 0]] * 3, [0, 0, 1], reach)
    assert oracle.closest(asked).primitive.tolist() == [-1, 0, 0]
    assert oracle.closest(asked).t.tolist() == nearly([np.inf, 1, 1])
    assert oracle.occluded(asked).tolist() == [False, True, True]
    assert np.array_equal(asked.reach, reach)


def test_the_thin_calls_say_the_same() -> None:
    rng = np.random.default_rng(5)
    soup = rng.normal(size=(200, 3, 3)).astype(np.float32)
    oracle = Oracle(soup)
    asked = rays(rng.normal(size=(500, 3)) * 2, rng.normal(size=(500, 3)), rng.random(500) * 5)
    hits = oracle.closest(asked)
    assert 50 < (hits.primitive >= 0).sum() < 450
    assert np.array_equal(oracle.trace_closest(asked), hits.primitive)
    assert np.array_equal(oracle.trace_occluded(asked) >= 0, hits.primitive >= 0)
    assert (hits.t[hits.primitive >= 0] <= asked.reach[hits.primitive >= 0]).all()


def test_a_ray_on_the_surface_hits_it_at_zero(oracle: Oracle) -> None:
    hits = oracle.closest(rays([0.2, 0.2, 1], [0, 0, 1]))
    assert (hits.t.tolist(), hits.primitive.tolist()) == ([0], [0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_rays_that_are_not_finite_miss(oracle: Oracle, bad: float) -> None:
    asked = rays([[bad, 0.2, 0], [0.2, 0.2, 0], [0.2, 0.2, 0]], [[0, 0, 1], [0, 0, bad], [0, bad, 1]])
    assert oracle.closest(asked).primitive.tolist() == [-1, -1, -1]
    assert not oracle.occluded(asked).any()


def test_no_direction_no_triangles_and_no_rays(oracle: Oracle) -> None:
    assert oracle.closest(rays([0.2, 0.2, 0], [0, 0, 0])).primitive.tolist() == [-1]
    empty = Oracle(STACK[:0])
    assert empty.closest(rays([0, 0, 0], [0, 0, 1])).primitive.tolist() == [-1]
    assert not empty.occluded(rays([0, 0, 0], [0, 0, 1])).any()
    none = rays([0, 0, 0], [0, 0, 1])[:0]
    assert len(oracle.closest(none).t) == len(oracle.occluded(none)) == 0


def test_vertices_with_faces_are_the_same_scene() -> None:
    vertices: Floats = STACK.reshape(-1, 3)
    faces = np.array([[3, 4, 5], [0, 1, 2]], np.int32)
    hits = Oracle(vertices, faces).closest(rays([0.2, 0.2, 0], [0, 0, 1]))
    assert (hits.t.tolist(), hits.primitive.tolist()) == (nearly([1]), [1])


def test_shapes_that_embreex_would_read_past_are_refused() -> None:
    with pytest.raises(ValueError, match="Give the oracle triangles"):
        Oracle(STACK.reshape(-1, 3))
    with pytest.raises(ValueError, match="a vertex that is not there"):
        Oracle(CORNERS, np.array([[0, 1, 3]], np.int32))
