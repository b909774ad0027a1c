"""The referee on scenes whose answers are plain, and with a structure or without."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from renderer.build.bvh import build_bvh
from renderer.build.tree import Bvh, SahCosts
from renderer.judge import referee
from renderer.records import Floats, Rays

INF = np.float32(np.inf)
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
QUAD = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)
DOWN = (0.0, 0.0, -1.0)


def rays(origin: object, direction: object, reach: object = INF) -> Rays:
    o, d = np.broadcast_arrays(np.array(origin, np.float32, ndmin=2), np.array(direction, np.float32, ndmin=2))
    return Rays(o.copy(), d.copy(), np.broadcast_to(np.array(reach, np.float32), len(o)).copy())


def tree(triangles: Floats) -> Bvh:
    return build_bvh(np.stack([triangles.min(axis=1), triangles.max(axis=1)], axis=1), SahCosts())


def test_one_triangle_from_both_sides_in_units_of_the_direction() -> None:
    asked = rays([[0.25, 0.25, 2], [0.25, 0.25, 2], [0.25, 0.25, -3], [0.25, 0.25, 2], [2, 2, 2]],
                 [DOWN, (0, 0, -4), (0, 0, 1), (0, 0, 1), DOWN])  # fmt: skip
    verdict = referee.closest(CORNERS[None], asked)
    assert verdict.t.tolist() == [2, 0.5, 3, np.inf, np.inf]
    assert verdict.primitive.tolist() == [0, 0, 0, -1, -1]
    assert referee.any_hit(CORNERS[None], asked).tolist() == [True, True, True, False, False]


def test_the_interval_is_open_at_zero_and_closed_at_the_reach() -> None:
    below = np.nextafter(np.float32(2), np.float32(0))
    asked = rays([[0.25, 0.25, 2], [0.25, 0.25, 2], [0.25, 0.25, 0]], DOWN, [below, 2, INF])
    assert referee.closest(CORNERS[None], asked).primitive.tolist() == [-1, 0, -1]
    assert referee.any_hit(CORNERS[None], asked).tolist() == [False, True, False]


def test_a_shared_diagonal_edges_and_vertices_are_hit_once_by_the_smaller_primitive() -> None:
    inside = np.linspace(0, 1, 9)
    points = [(x, x) for x in inside] + [(x, 0) for x in inside] + [(1, y) for y in inside]
    asked = rays([(x, y, 1) for x, y in points], DOWN)
    assert (referee.closest(QUAD, asked).primitive == 0).all()
    assert (referee.closest(QUAD[::-1].copy(), asked).primitive[:9] == 0).all()
    assert np.abs(referee.edge_margin(QUAD, asked, np.zeros(len(points), np.int32))).max() == 0


def test_one_ulp_outside_is_a_miss_within_the_bound() -> None:
    outside = np.nextafter(np.array([0, 1], np.float32), np.array([-1, 2], np.float32))
    asked = rays([(outside[0], 0.5, 1), (outside[1], 0.5, 1)], DOWN)
    assert referee.closest(QUAD, asked).primitive.tolist() == [-1, -1]
    margin = referee.edge_margin(QUAD, asked, np.array([1, 0], np.int32))
    assert ((margin > -1) & (margin < 0)).all()
    assert referee.any_hit(QUAD, asked, grow=1.0).all()


def test_shrinking_and_growing_move_an_edge_by_the_bound() -> None:
    x = np.array([1 + 1e-3, 1 + 1.2e-7, 1 - 0.6e-7, 1 - 1e-3], np.float32)
    asked = rays(np.stack([x, np.full(4, 0.5), np.ones(4)], axis=1), DOWN)
    answers = [referee.any_hit(QUAD, asked, grow=grow).tolist() for grow in (-1.0, 0.0, 1.0)]
    assert answers == [[False, False, False, True], [False, False, True, True], [False, True, True, True]]


def test_a_limit_shortens_the_ray() -> None:
    asked = rays([[0.25, 0.25, 2]] * 2, DOWN)
    assert referee.any_hit(QUAD, asked, limit=np.array([1.5, 2.5])).tolist() == [False, True]


def test_duplicates_go_to_the_smallest_primitive() -> None:
    rng = np.random.default_rng(11)
    copies = np.repeat(CORNERS[None], 40, axis=0)
    copies[:7] += 5
    asked = rays(np.append(rng.random((50, 2)) * 0.4, np.ones((50, 1)), axis=1), DOWN)
    assert (referee.closest(copies, asked).primitive == 7).all()
    assert (referee.closest(copies, asked, tree(copies)).primitive == 7).all()


def test_axis_parallel_rays_in_the_plane_miss() -> None:
    asked = rays(
        [[-1, 0.25, 0], [0.25, -1, 0], [-1, 0, 0], [2, 0, 0]], [[1, 0, 0], [0, 1, 0], [1, 0, 0], [-1, -0.0, 0]]
    )
    assert (referee.closest(QUAD, asked).primitive == -1).all()
    assert np.isnan(referee.plane_t(QUAD, asked, np.zeros(4, np.int32))).all()
    assert np.isinf(referee.t_bound(QUAD, asked, np.zeros(4, np.int32))).all()


def test_rays_along_an_axis_within_box_faces_still_hit() -> None:
    box = np.asarray(trimesh.creation.box().triangles, np.float32)
    asked = rays([[0.5, 0.5, 3], [0.5, 0.25, 3], [-3, 0.5, 0.1]], [[-0.0, 0, -1], [0, -0.0, -1], [1, 0, 0]])
    found = referee.closest(box, asked, tree(box))
    assert found.t.tolist() == [2.5, 2.5, 2.5]
    assert np.array_equal(found.primitive, referee.closest(box, asked).primitive)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_rays_that_are_not_finite_and_degenerate_triangles_miss(bad: float) -> None:
    asked = rays([[bad, 0.2, 1], [0.2, 0.2, 1]], [DOWN, (0, bad, -1)])
    assert referee.closest(QUAD, asked).primitive.tolist() == [-1, -1]
    needle = np.array([[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0]] * 3], np.float32)
    assert not referee.any_hit(needle, rays([[0.5, 0, 1], [0, 0, 1]], DOWN)).any()


def test_no_rays_no_triangles() -> None:
    assert len(referee.closest(QUAD, rays([0, 0, 0], DOWN)[:0]).t) == 0
    assert referee.closest(QUAD[:0], rays([0, 0, 1], DOWN)).primitive.tolist() == [-1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_closed_surface_has_no_holes_from_within(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=3)
    triangles = np.asarray(ball.triangles, np.float32)
    origin = rng.uniform(-0.4, 0.4, 3).astype(np.float32)
    edge = rng.random((len(ball.edges_unique), 1))
    a, b = (ball.vertices[ball.edges_unique[:, k]] for k in (0, 1))
    targets = np.concatenate([rng.normal(size=(5000, 3)), ball.vertices, a * edge + b * (1 - edge)])
    asked = rays(origin, targets - origin)
    found = referee.closest(triangles, asked, tree(triangles))
    assert (found.primitive >= 0).all()
    # A sphere's chord lies between the sphere and the facets' nearest points to the centre.
    points = origin + found.t[:, None] * asked.direction.astype(np.float64)
    assert np.all((np.linalg.norm(points, axis=1) > 0.98) & (np.linalg.norm(points, axis=1) < 1 + 1e-6))


@pytest.mark.parametrize("seed", [31, 32])
@pytest.mark.parametrize("grow", [-1.0, 0.0, 1.0])
def test_a_structure_changes_no_answer(seed: int, grow: float) -> None:
    rng = np.random.default_rng(seed)
    soup = (rng.normal(size=(3000, 1, 3)) + rng.normal(size=(3000, 3, 3)) * 0.2).astype(np.float32)
    soup[::7] = soup[::7].round(1)
    soup[1::7] = soup[::7][: len(soup[1::7])]
    bvh = tree(soup)
    start = rng.normal(size=(600, 3)) * 2
    aim = soup[rng.integers(0, 3000, 600), rng.integers(0, 3, 600)]
    asked = rays(start, aim - start, rng.choice([0.5, 1, 2, np.inf], 600))
    plain, walked = referee.closest(soup, asked), referee.closest(soup, asked, bvh)
    assert np.array_equal(plain.t, walked.t)
    assert np.array_equal(plain.primitive, walked.primitive)
    assert np.array_equal(referee.any_hit(soup, asked, grow=grow), referee.any_hit(soup, asked, bvh, grow=grow))
