"""Exact signs: sums of products of float32 values as expansions of float64 (Shewchuk 1997, sections 2.4 to 2.8).

An expansion is `e[:n]`, non-overlapping float64 of growing magnitude without zeros; its value is their exact sum, and
its sign that of the last. Every quantity here is a sum of products of at most six float32 values, all of them finite:
a multiple of 2^-894 (6 * -149) below 2^800, so nothing overflows, and no rounding error underflows.

With a, b, c the corners, o the origin and d the direction, let volume(d; p, q, r) = d . (p x q + q x r + r x p). Then

    the line's side of edge ab   d . ((a - o) x (b - o)) = volume(d; a, b, o)
    n . d                        n = (b - a) x (c - a), so volume(d; a, b, c)
    n . (a - o)                  volume(a; a, b, c) - volume(o; a, b, c)

and t = n . (a - o) / n . d: 18 or 36 products of three float32 values, in which no difference is ever rounded.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.judge.referee.vectors import Corners, Vector

Expansion = npt.NDArray[np.float64]

TERMS = 72
"""The longest expansion of a volume's difference: 36 products of two parts each."""


@jit
def two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b as the rounded sum and its error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@jit
def two_product(a: float, b: float) -> tuple[float, float]:
    """a b as the rounded product and its error (Dekker, Veltkamp)."""
    product = a * b
    wide_a, wide_b = 134217729.0 * a, 134217729.0 * b  # 2^27 + 1
    high_a, high_b = wide_a - (wide_a - a), wide_b - (wide_b - b)
    low_a, low_b = a - high_a, b - high_b
    return product, ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b


@jit
def add(e: Expansion, n: int, term: float) -> int:
    """Add `term` to e[:n] in place, and return the new length (Grow-Expansion with zeros left out)."""
    kept = 0
    for i in range(n):
        term, error = two_sum(term, e[i])
        if error != 0.0:
            e[kept] = error
            kept += 1
    if term != 0.0:
        e[kept] = term
        kept += 1
    return kept


@jit
def _add_product(e: Expansion, n: int, a: float, b: float) -> int:
    high, low = two_product(a, b)
    return add(e, add(e, n, low), high)


@jit
def _add_volume(e: Expansion, n: int, d: Vector, p: Vector, q: Vector, r: Vector) -> int:
    """Add volume(d; p, q, r); a product of two float32 values is exact in float64."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for x, y in ((p, q), (q, r), (r, p)):
            n = _add_product(e, n, x[i] * y[j], d[k])
            n = _add_product(e, n, -x[j] * y[i], d[k])
    return n


@jit
def sign(e: Expansion, n: int) -> int:
    """The sign of an expansion: -1, 0 or 1."""
    if n == 0:
        return 0
    return 1 if e[n - 1] > 0.0 else -1


@jit
def estimate(e: Expansion, n: int) -> float:
    """The value of an expansion to within an ulp."""
    total = 0.0
    for i in range(n):
        total += e[i]
    return total


@jit
def side(o: Vector, d: Vector, a: Vector, b: Vector) -> int:
    """The sign of d . ((a - o) x (b - o)): on which side of the line through o along d the edge from a to b passes."""
    e = np.empty(TERMS)
    return sign(e, _add_volume(e, 0, d, a, b, o))


@jit
def ratio(o: Vector, d: Vector, corners: Corners) -> tuple[Expansion, Expansion]:
    """n . (a - o) and n . d, whose quotient is t."""
    a, b, c = corners
    above, below = np.empty(TERMS), np.empty(TERMS)
    n = _add_volume(above, 0, a, a, b, c)
    n = _add_volume(above, n, (-o[0], -o[1], -o[2]), a, b, c)
    m = _add_volume(below, 0, d, a, b, c)
    return above[: _compress(above, n)], below[: _compress(below, m)]


@jit
def _compress(e: Expansion, n: int) -> int:
    """Shorten e[:n] in place to parts that do not touch (Shewchuk, figure 15), and return their number."""
    if n == 0:
        return 0
    bottom, carry = n - 1, e[n - 1]
    for i in range(n - 2, -1, -1):
        total, error = two_sum(carry, e[i])
        if error != 0.0:
            e[bottom] = total
            bottom -= 1
            carry = error
        else:
            carry = total
    e[bottom] = carry
    top = 0
    for i in range(bottom + 1, n):
        carry, error = two_sum(e[i], carry)
        if error != 0.0:
            e[top] = error
            top += 1
    e[top] = carry
    return top + 1


@jit
def quotient(o: Vector, d: Vector, corners: Corners) -> float:
    """t to within 4 ulp of float64; NaN where the ray is parallel to the plane, or the triangle has none."""
    above, below = ratio(o, d, corners)
    if len(below) == 0:
        return np.nan
    return estimate(above, len(above)) / estimate(below, len(below))


@jit
def compare(o: Vector, d: Vector, first: Corners, second: Corners) -> int:
    """The sign of t of the first triangle's plane less t of the second's; both are crossed."""
    above_1, below_1 = ratio(o, d, first)
    above_2, below_2 = ratio(o, d, second)
    e = np.empty(2 * (len(above_1) * len(below_2) + len(above_2) * len(below_1)) + 1)
    n = 0
    for x in above_1:
        for y in below_2:
            n = _add_product(e, n, x, y)
    for x in above_2:
        for y in below_1:
            n = _add_product(e, n, -x, y)
    return sign(e, n) * sign(below_1, len(below_1)) * sign(below_2, len(below_2))


@jit
def compare_with(o: Vector, d: Vector, corners: Corners, limit: float) -> int:
    """The sign of t of the triangle's plane, which is crossed, less `limit`: a finite float64 of 2^-149 to 2^200."""
    above, below = ratio(o, d, corners)
    e = np.empty(len(above) + 2 * len(below) + 1)
    n = 0
    for x in above:
        n = add(e, n, x)
    for y in below:
        n = _add_product(e, n, -limit, y)
    return sign(e, n) * sign(below, len(below))
