"""Bins find the cut that a search of all cuts finds, and what they move and sort keeps its order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from build_soups import SOUPS, Floats, soup

from renderer.build.bounded import bounded_split
from renderer.build.sorted_range import sort_range
from renderer.build.sweep import NO_SPLIT, Rules

FREE = Rules(True, 64, 0.0, 1.0, True)
"""Visits cost nothing, so that every cut that separates anything pays."""


def areas_from_left(rows: Floats) -> npt.NDArray[np.float64]:
    """Half the surface of the box around the first 1, 2, ... of `rows` (n, 6)."""
    low, high = np.minimum.accumulate(rows[:, :3]), np.maximum.accumulate(rows[:, 3:])
    x, y, z = (high.astype(np.float64) - low).T
    area: npt.NDArray[np.float64] = x * y + z * (x + y)
    return area


def costs_of(rows: Floats, axis: int) -> npt.NDArray[np.float64]:
    """What each of the n - 1 cuts of one axis's order costs."""
    ordered = rows[np.argsort(rows[:, axis] + rows[:, axis + 3], kind="stable")]
    number = np.arange(1, len(rows))
    left, right = areas_from_left(ordered)[:-1], areas_from_left(ordered[::-1])[:-1][::-1]
    return left * number + right * (len(rows) - number)


def split(rows: Floats, rules: Rules) -> tuple[int, int, Floats, npt.NDArray[np.uint32]]:
    moved, ids = rows.copy(), np.arange(len(rows), dtype=np.uint32)
    axis, cut = bounded_split(moved, ids, np.empty_like(rows), np.empty_like(ids), 0, len(rows), rules)
    return axis, cut, moved, ids


def cut_cost(rows: Floats, cut: int) -> float:
    return float(areas_from_left(rows[:cut])[-1] * cut + areas_from_left(rows[cut:])[-1] * (len(rows) - cut))


def scattered(number: int, seed: int) -> Floats:
    return soup(number, seed, size=0.05).reshape(-1, 6)


def in_steps(number: int, seed: int) -> Floats:
    """Many share a centroid, and some of these a box."""
    rows = np.round(scattered(number, seed) * 4) / 4
    rows[:, 3:] = rows[:, :3] + 0.25 * np.round(1 + np.random.default_rng(seed).random((number, 1)))
    return rows.astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("number", [3, 40, 700, 5000])
@pytest.mark.parametrize("make", [scattered, in_steps])
def test_the_cut_is_the_cheapest_of_all(make: Callable[[int, int], Floats], number: int, seed: int) -> None:
    rows = make(number, seed)
    axis, cut, moved, ids = split(rows, FREE)
    assert axis != NO_SPLIT
    np.testing.assert_array_equal(moved, rows[ids])
    key = moved[:, axis] + moved[:, axis + 3]
    assert key[:cut].max() <= key[cut:].min()
    assert (np.diff(ids[:cut].astype(int)) > 0).all()
    assert (np.diff(ids[cut:].astype(int)) > 0).all()
    assert cut_cost(moved, cut) == pytest.approx(min(costs_of(rows, k).min() for k in range(3)), rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_a_border_costs_little_more(seed: int) -> None:
    rows = scattered(5000, seed)
    axis, cut, moved, _ = split(rows, FREE._replace(exact=False))
    least = min(costs_of(rows, k).min() for k in range(3))
    assert axis != NO_SPLIT
    assert least * (1 - 1e-5) <= cut_cost(moved, cut) <= 1.02 * least


def test_what_is_not_worth_a_cut_is_left_alone() -> None:
    one_place = np.repeat(scattered(1, 1), 3000, axis=0)
    for rows, rules in ((one_place, FREE), (scattered(3000, 2), FREE._replace(traversal=1e9))):
        axis, cut, moved, ids = split(rows, rules)
        assert (axis, cut) == (NO_SPLIT, 0)
        np.testing.assert_array_equal(moved, rows)
        np.testing.assert_array_equal(ids, np.arange(3000))


@pytest.mark.parametrize("name", SOUPS)
def test_ranges_are_sorted_stably(name: str) -> None:
    rows = np.ascontiguousarray(SOUPS[name]().reshape(-1, 6))
    scale = np.float32(1.0 / max(np.abs(rows).max(), np.float32(1.0)))
    rows = (rows * scale).astype(np.float32)
    begin = len(rows) // 3
    lists = np.zeros((3, len(rows)), np.uint32)
    sort_range(rows, lists, begin, len(rows))
    for axis in range(3):
        order = begin + np.argsort(rows[begin:, axis] + rows[begin:, axis + 3], kind="stable")
        np.testing.assert_array_equal(lists[axis, begin:], order)
        assert (lists[axis, :begin] == 0).all()
