"""What a ray hits, decided exactly: float64 with an error bound first, expansions where the bound leaves a sign open.

The filter. Let u = 2^-53, |v| the sum of a vector's magnitudes, and A = a - o, E = b - a as float64 rounds them, each
component within u of itself. A triple product of three vectors costs 1 rounding for each difference, 1 for each of the
products, 1 for the cross product's subtraction and 2 for the last sum, on terms that add up to at most |d||A||E|: at
most 7 u |d||A||E| to first order, so FILTER = 16 u leaves room for the higher orders and for the bound's own rounding.
Nothing overflows, and what underflows is 2^-447 at least, far inside the range of float64. The same holds for
n . A with n = E x F and for n . d.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from renderer.jit import inline, jit
from renderer.judge.referee import exact
from renderer.judge.referee.vectors import Corners, Vector, cross, dot, minus, span

Tally = npt.NDArray[np.int64]

FILTER = 2.0**-49
OPEN = 2
"""The sign that the filter could not tell."""

COARSE = 2.0**-30
"""How well every t is known, relatively, while hits are compared; expansions compare two closer than 4 COARSE."""

FINE = 2.0**-43
"""How well a t that is reported is known, relatively."""

SIDES, TIMES, ORDERS = range(3)
"""What a tally counts: sides of edges, values of t and comparisons of two that float64 left open."""


@inline
def _filtered(value: float, bound: float) -> int:
    """The sign of `value`, which is `bound` away from the truth at most."""
    if value > bound:
        return 1
    return -1 if value < -bound else OPEN


@jit
def crosses(corners: Corners, o: Vector, d: Vector, tally: Tally) -> bool:
    """Whether the ray's line crosses the closed triangle in one point."""
    a, b, c = corners
    to_a, to_b, ab = minus(a, o), minus(b, o), minus(b, a)
    unit = FILTER * span(d)
    reach_a, reach_b = unit * span(to_a), unit * span(to_b)
    at_ab = _filtered(dot(d, cross(to_a, ab)), reach_a * span(ab))
    bc = minus(c, b)
    at_bc = _filtered(dot(d, cross(to_b, bc)), reach_b * span(bc))
    if at_ab * at_bc == -1:
        return False
    ac = minus(c, a)
    at_ca = _filtered(dot(d, cross(ac, to_a)), reach_a * span(ac))
    if at_ab == at_bc == at_ca != OPEN:
        return True
    if at_ab * at_ca == -1 or at_bc * at_ca == -1:
        return False
    return _crosses_exactly(corners, o, d, (at_ab, at_bc, at_ca), tally)


@jit
def _crosses_exactly(corners: Corners, o: Vector, d: Vector, sides: tuple[int, int, int], tally: Tally) -> bool:
    """`crosses`, with the sides that the filter left open.

    The three volumes add up to n . d. So where none has the other's sign and one is not 0, n . d is not 0 either, and
    the volumes over n . d are the barycentric coordinates of the one point where line and plane meet.
    """
    a, b, c = corners
    if not math.isfinite(span(a) + span(b) + span(c)):
        return False
    least, most = 0, 0
    for k in range(3):
        if sides[k] != OPEN:
            least, most = min(least, sides[k]), max(most, sides[k])
    for k in range(3):
        if sides[k] == OPEN:
            tally[SIDES] += 1
            found = exact.side(o, d, corners[k], corners[(k + 1) % 3])
            least, most = min(least, found), max(most, found)
            if least < 0 < most:
                return False
    return least != most


@jit
def time_of(corners: Corners, o: Vector, d: Vector, tolerance: float, tally: Tally) -> float:
    """t of the triangle's plane within a relative `tolerance`, its sign exact; NaN where it is not crossed."""
    a, b, c = corners
    to_a, ab, ac = minus(a, o), minus(b, a), minus(c, a)
    normal = cross(ab, ac)
    above, below = dot(normal, to_a), dot(normal, d)
    unit = FILTER * span(ab) * span(ac)
    # Halves, since the errors of numerator and denominator add up.
    enough = unit * span(to_a) <= 0.5 * tolerance * abs(above) and unit * span(d) <= 0.5 * tolerance * abs(below)
    if enough and below != 0.0:
        return above / below
    tally[TIMES] += 1
    if not math.isfinite(unit):
        return np.nan
    return exact.quotient(o, d, corners)


@jit
def within(t: float, corners: Corners, o: Vector, d: Vector, limit: float, tally: Tally) -> bool:
    """Whether t of the triangle's plane, known to COARSE, lies in (0, limit]."""
    if not t > 0.0:
        return False
    if limit == np.inf or abs(t - limit) > 4.0 * COARSE * limit:
        return t <= limit
    if limit <= 0.0:
        return False
    tally[ORDERS] += 1
    return exact.compare_with(o, d, corners, limit) <= 0


@jit
def order(t: float, corners: Corners, best: float, other: Corners, o: Vector, d: Vector, tally: Tally) -> int:
    """The sign of t of one triangle's plane less that of another's, both known to COARSE and above 0."""
    if abs(t - best) > 4.0 * COARSE * best:
        return 1 if t > best else -1
    if corners == other:
        return 0
    tally[ORDERS] += 1
    return exact.compare(o, d, corners, other)
