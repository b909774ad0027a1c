"""How far float32 may be from the truth: bounds on the edges and on the t of two ray-triangle tests.

Let eps = 2^-24, gamma(n) = n eps / (1 - n eps) (Pharr, Jakob, Humphreys, section 6.8), and [a b c] the triple product
of the vectors' magnitudes with all signs made positive: |a_x| (|b_y| |c_z| + |b_z| |c_y|) + ...

Moller and Trumbore (1997), as shaders/intersector_moller_trumbore.glsl computes it, rounds e1, e2 and s = o - v0 once
and decides by the signs of U = s . (d x e2), V = d . (s x e1) and W = det - U - V, det = e1 . (d x e2), each of them
over det. No term of a triple product passes more than 7 roundings: 2 for rounded inputs, 2 for the cross product, 3
for the dot product. Comparing u + v with 1, after u = U (1 / det) and v = V (1 / det), rounds thrice more:

    edge v2 v0:  |error of U| <= gamma(7) [d s e2]          edge v0 v1:  |error of V| <= gamma(7) [d s e1]
    edge v1 v2:  |error of W| <= gamma(7) ([d s e2] + [d s e1] + [d e1 e2]) + 3 eps |det|
    t:           |error| <= gamma(7) ([s e1 e2] + |t| [d e1 e2]) / (|det| - gamma(7) [d e1 e2]) + 2 eps |t|

Where gamma(7) [d e1 e2] >= |det| float32 cannot tell the two sides of the plane apart: then t means nothing, and each
sign of det is tried. The test's last step, clamping t into the triangle's own box, can reject a ray as well, if the box
is left before it is entered: by rounding that takes less than 3 eps t between two axes, which happens at corners of the
box only, and of 6 million rays aimed at edges and vertices lost none that the above calls found.

Watertight (Woop, Benthin, Wald 2013) moves corners to the origin and shears them, x = A_x - (d_x / d_z) A_z with z the
axis of the largest |d|, which rounds A_x thrice and the product 5 times at most, and decides by U = C_x B_y - C_y B_x
and so on. So, with dx the error of a sheared coordinate,

    |error of U| <= |C_x| dB_y + |B_y| dC_x + |C_y| dB_x + |B_x| dC_y + 2 eps (|C_x B_y| + |C_y B_x|)

and t = (U A_z + V B_z + W C_z) / (U + V + W) with A_z over d_z, which rounds 5 times more.

Products that underflow lose 2^-126 each, as GPUs flush them; where one may overflow, float32 may answer anything.
A volume U is |edge| |n . d| times the distance, in the triangle's plane, from the ray's point to the edge (n of length
1): in distances both bounds grow with how far the triangle is from the ray's origin and with grazing, and not with how
far both are from the world's origin. The edge margin is U over its bound, the least of the three edges.
"""

from __future__ import annotations

import numpy as np

from renderer.jit import inline, jit
from renderer.judge.referee.vectors import Corners, Vector, cross, dot, magnitudes, minus, span

EPS = 2.0**-24
GAMMA = 7 * EPS / (1 - 7 * EPS)
FLUSHED = 2.0**-126
LARGEST = 2.0**126
"""Beyond it 1 / det is flushed to 0, and four times as much is infinite."""

MOLLER_TRUMBORE, WATERTIGHT, EITHER = range(3)


@jit
def measure(corners: Corners, o: Vector, d: Vector, test: int) -> Vector:
    """Plane t (NaN when parallel), its float32 bound and the edge margin of a triangle under a test.

    EITHER is for other tests: the wider of the two bounds. Float64 rounds by 2^-50 what float32's bounds take by
    2^-22, in the same products of magnitudes: edges come from the corners themselves, not from corners relative to
    the origin, and stay right however small they are beside their distance.
    """
    if test == MOLLER_TRUMBORE:
        return _moller_trumbore(corners, o, d)
    if test == WATERTIGHT:
        return _watertight(corners, o, d)
    t, bound, margin = _moller_trumbore(corners, o, d)
    _, other_bound, other = _watertight(corners, o, d)
    return t, max(bound, other_bound), margin if abs(margin) < abs(other) else other


@jit
def _moller_trumbore(corners: Corners, o: Vector, d: Vector) -> Vector:
    a, b, c = corners
    s, ab, ac = minus(a, o), minus(b, a), minus(c, a)
    at_ab, at_bc, at_ca = dot(d, cross(s, ab)), dot(d, cross(minus(b, o), minus(c, b))), dot(d, cross(ac, s))
    normal = cross(ab, ac)
    above, det = dot(normal, s), dot(normal, d)
    in_u, in_v, in_det, in_t = volume(d, s, ac), volume(d, s, ab), volume(d, ab, ac), volume(s, ab, ac)
    if not max(in_u, in_v, in_det, in_t) < LARGEST:
        return above / det if det != 0.0 else np.nan, np.inf, 0.0
    u_room = GAMMA * in_u + _flushed(s)
    v_room = GAMMA * in_v + _flushed(d)
    det_room = GAMMA * in_det + _flushed(ab)
    t_room = GAMMA * in_t + _flushed(ac)
    w_room = u_room + v_room + det_room + 3.0 * EPS * abs(det)
    margins = _ratio(at_ca, u_room), _ratio(at_ab, v_room), _ratio(at_bc, w_room)
    t = above / det if det != 0.0 else np.nan
    return _figures(t, det, t_room + abs(t) * det_room, det_room, margins)


@jit
def _watertight(corners: Corners, o: Vector, d: Vector) -> Vector:
    a, b, c = corners
    k = 0 if abs(d[0]) >= max(abs(d[1]), abs(d[2])) else 1 if abs(d[1]) >= abs(d[2]) else 2
    i, j = (k + 1) % 3, (k + 2) % 3
    pa, pb, pc = minus(a, o), minus(b, o), minus(c, o)
    normal = cross(minus(b, a), minus(c, a))
    above, det = dot(normal, pa), dot(normal, d)
    if not max(span(pa), span(pb), span(pc)) ** 3 < LARGEST:
        return above / det if det != 0.0 else np.nan, np.inf, 0.0
    slope = d[i] / d[k] if d[k] != 0.0 else 0.0, d[j] / d[k] if d[k] != 0.0 else 0.0
    at_a, at_b, at_c = _sheared(pa, slope, i, j, k), _sheared(pb, slope, i, j, k), _sheared(pc, slope, i, j, k)
    # Volumes here are d . (b x c); sheared areas are those over d_k.
    away = abs(d[k])
    u_room = away * _sheared_room(at_b, at_c)
    v_room = away * _sheared_room(at_c, at_a)
    w_room = away * _sheared_room(at_a, at_b)
    u, v, w = dot(d, cross(pb, minus(c, b))), dot(d, cross(minus(c, a), pa)), dot(d, cross(pa, minus(b, a)))
    margins = _ratio(u, u_room), _ratio(v, v_room), _ratio(w, w_room)
    det_room = u_room + v_room + w_room + 2.0 * EPS * (abs(u) + abs(v) + abs(w))
    t = above / det if det != 0.0 else np.nan
    # t is the mean of the corners' A_z / d_k by U, V, W: what these err counts by how far the corners are from it.
    z_a, z_b, z_c = pa[k] / d[k], pb[k] / d[k], pc[k] / d[k]
    off = u_room * abs(z_a - t) + v_room * abs(z_b - t) + w_room * abs(z_c - t)
    off += 5.0 * EPS * (abs(u * z_a) + abs(v * z_b) + abs(w * z_c))
    return _figures(t, det, off + 2.0 * EPS * abs(t) * (abs(u) + abs(v) + abs(w)), det_room, margins)


@jit
def _figures(t: float, det: float, off: float, det_room: float, margins: Vector) -> Vector:
    """t, its bound `off` / det where float32 resolves det, and the edge margin."""
    u, v, w = margins
    rest = abs(det) - det_room
    if rest > 2.0 * FLUSHED:
        return t, off / rest + 2.0 * EPS * abs(t), min(u, v, w) if det > 0.0 else min(-u, -v, -w)
    return t, np.inf, max(min(u, v, w), min(-u, -v, -w))


@inline
def volume(a: Vector, b: Vector, c: Vector) -> float:
    """The triple product with all signs positive, [a b c]."""
    x, y, z = magnitudes(a), magnitudes(b), magnitudes(c)
    return x[0] * (y[1] * z[2] + y[2] * z[1]) + x[1] * (y[2] * z[0] + y[0] * z[2]) + x[2] * (y[0] * z[1] + y[1] * z[0])


@inline
def _flushed(factor: Vector) -> float:
    """What a triple product loses to underflow, where `factor` multiplies a cross product."""
    return FLUSHED * (3.0 * span(factor) + 5.0)


@inline
def _sheared(p: Vector, slope: tuple[float, float], i: int, j: int, k: int) -> tuple[float, float, float, float]:
    """A corner's sheared coordinates, and their errors."""
    x, y = slope[0] * p[k], slope[1] * p[k]
    return (
        p[i] - x,
        p[j] - y,
        EPS * (3.0 * abs(p[i]) + 5.0 * abs(x)) + 2.0 * FLUSHED,
        EPS * (3.0 * abs(p[j]) + 5.0 * abs(y)) + 2.0 * FLUSHED,
    )


@inline
def _sheared_room(p: tuple[float, float, float, float], q: tuple[float, float, float, float]) -> float:
    """The error of p_x q_y - p_y q_x."""
    inputs = abs(p[0]) * q[3] + abs(q[1]) * p[2] + abs(p[1]) * q[2] + abs(q[0]) * p[3] + p[2] * q[3] + p[3] * q[2]
    return inputs + 2.0 * EPS * (abs(p[0] * q[1]) + abs(p[1] * q[0])) + 3.0 * FLUSHED


@inline
def _ratio(distance: float, bound: float) -> float:
    return distance / bound if bound > 0.0 else 0.0
