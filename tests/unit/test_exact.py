"""Expansions against rationals: error-free sums and products, and signs of what cancels to the last bit."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_cases import FAMILIES, Doubles, rational, triple

from renderer.judge.referee import exact
from renderer.judge.referee.vectors import Corners, Vector
from renderer.records import Floats

SEEDS = (1, 2, 3)


def doubles(rng: np.random.Generator, n: int, least: int, most: int) -> list[float]:
    """Doubles of random exponents and signs, some of few bits."""
    mantissa = np.where(rng.random(n) < 0.3, rng.integers(-8, 9, n), rng.normal(size=n))
    values: list[float] = np.ldexp(mantissa, rng.integers(least, most, n)).tolist()
    return values


def value(expansion: Doubles, n: int) -> Fraction:
    return sum((Fraction(x) for x in expansion[:n].tolist()), Fraction(0))


def vector(point: Floats) -> Vector:
    x, y, z = (float(value) for value in point)
    return x, y, z


def corners(triangle: Floats) -> Corners:
    a, b, c = (vector(point) for point in triangle)
    return a, b, c


def sign(number: Fraction) -> int:
    return (number > 0) - (number < 0)


@pytest.mark.parametrize("seed", SEEDS)
def test_sums_and_products_lose_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lost = 0
    for a, b in zip(doubles(rng, 3000, -400, 400), doubles(rng, 3000, -400, 400), strict=True):
        total, error = exact.two_sum(a, b)
        assert total == a + b
        assert Fraction(total) + Fraction(error) == Fraction(a) + Fraction(b)
        product, error = exact.two_product(a, b)
        assert product == a * b
        assert Fraction(product) + Fraction(error) == Fraction(a) * Fraction(b)
        lost += error != 0.0
    assert lost > 1000


@pytest.mark.parametrize("seed", SEEDS)
def test_an_expansion_is_the_exact_sum_in_parts_that_do_not_overlap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for spread in (1, 60, 700):
        terms = doubles(rng, 40, -spread, spread)
        terms += [-x for x in terms[:20]] + [terms[30] * 2.0**-200]
        e = np.empty(len(terms))
        n = 0
        for term in rng.permutation(terms).tolist():
            n = exact.add(e, n, term)
        assert value(e, n) == sum(map(Fraction, terms))
        assert exact.sign(e, n) == sign(value(e, n))
        assert (np.abs(e[1:n]) > np.abs(e[: n - 1])).all()
        assert (e[:n] != 0).all()
        assert abs(Fraction(exact.estimate(e, n)) - value(e, n)) <= abs(value(e, n)) * Fraction(2) ** -51


def test_a_sum_that_cancels_is_zero() -> None:
    e = np.empty(4)
    n = 0
    for term in (1e300, 1e-300, -1e300, -1e-300):
        n = exact.add(e, n, term)
    assert (n, exact.sign(e, n), exact.estimate(e, n)) == (0, 0, 0.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_sides_and_times_as_rationals_have_them(family: str) -> None:
    triangles, asked = FAMILIES[family](np.random.default_rng([7, *family.encode()]))
    rng = np.random.default_rng(8)
    sides, orders = set(), set()
    for r in range(len(asked)):
        o, d = vector(asked.origin[r]), vector(asked.direction[r])
        i, j = rng.integers(0, len(triangles), 2)
        side, expected = exact.side(o, d, *corners(triangles[i])[:2]), volume(asked.origin[r], d, triangles[i])
        assert side == sign(expected)
        sides.add(side)
        t, other = (plane_t(triangles[k], asked.origin[r], asked.direction[r]) for k in (i, j))
        found = exact.quotient(o, d, corners(triangles[i]))
        assert np.isnan(found) if t is None else abs(Fraction(found) - t) <= abs(t) * Fraction(2) ** -50
        if t is None or other is None:
            continue
        order = exact.compare(o, d, corners(triangles[i]), corners(triangles[j]))
        assert order == sign(t - other)
        orders.add(order)
        limit = np.float32(max(min(float(abs(t)), 2.0**127), 2.0**-149))
        assert exact.compare_with(o, d, corners(triangles[i]), float(limit)) == sign(t - rational(limit))
    assert {-1, 1} <= sides
    assert {-1, 1} <= orders


def volume(o: Floats, d: Vector, triangle: Floats) -> Fraction:
    """d . ((a - o) x (b - o)) over a triangle's first edge."""
    a, b = ([rational(x) - rational(y) for x, y in zip(corner, o, strict=True)] for corner in triangle[:2])
    return triple([Fraction(x) for x in d], a, b)


def plane_t(triangle: Floats, o: Floats, d: Floats) -> Fraction | None:
    """t of the triangle's plane, or None where it is not crossed."""
    a, b, c = ([rational(x) for x in corner] for corner in triangle)
    ab, ac = ([p - q for p, q in zip(x, a, strict=True)] for x in (b, c))
    below = triple([rational(x) for x in d], ab, ac)
    if below == 0:
        return None
    return triple([p - rational(q) for p, q in zip(a, o, strict=True)], ab, ac) / below
