"""Ray-triangle tests in float32, as the shaders compute them, one triangle a ray, and rays that are hard on them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.records import Flags, Floats, Rays

Doubles = npt.NDArray[np.float64]
Found = tuple[Flags, Floats]
Vectors = npt.NDArray[Any]

STILL = np.float32(2.0**-80)
WIDEN = np.float32(1 + 2.0**-22)


def cross(a: Vectors, b: Vectors) -> Vectors:
    x, y, z = a.T
    p, q, r = b.T
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=1)


def dot(a: Vectors, b: Vectors) -> Vectors:
    product: Vectors = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]
    return product


def moller_trumbore(triangles: Floats, asked: Rays) -> Found:
    """shaders/intersector_moller_trumbore.glsl: whether it is hit, its box included, and t after the clamp."""
    a, b, c = (triangles[:, k] for k in range(3))
    with np.errstate(all="ignore"):
        ab, ac = b - a, c - a
        p = cross(asked.direction, ac)
        inverse = np.float32(1) / dot(ab, p)
        s = asked.origin - a
        q = cross(s, ab)
        u, v, t = dot(s, p) * inverse, dot(asked.direction, q) * inverse, dot(ac, q) * inverse
        entry, leave = own_box(triangles, asked)
        return (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (entry <= leave), np.clip(t, entry, leave)


def own_box(triangles: Floats, asked: Rays) -> tuple[Floats, Floats]:
    """Where the ray enters and leaves the triangle's box by shaders/common_slab.glsl."""
    still = np.abs(asked.direction) < STILL
    inverse = np.where(still, np.float32(2.0**120), np.float32(1) / asked.direction)
    stay = np.where(still, np.float32(2.0**40), np.float32(0))
    origin = asked.origin + stay * np.float32(2.0**-123)
    at = (triangles - origin[:, None]) * inverse[:, None]
    entry: Floats = np.maximum(at.min(axis=1).max(axis=1), np.float32(0))
    leave: Floats = (at.max(axis=1) + stay).min(axis=1) * WIDEN
    return entry, leave


def watertight(triangles: Floats, asked: Rays) -> Found:
    """Woop, Benthin and Wald 2013, section 3, where an edge function that rounds to 0 is computed again in float64."""
    d = asked.direction
    rows = np.arange(len(d))
    z = np.abs(d).argmax(axis=1)
    x, y = (z + 1) % 3, (z + 2) % 3
    along = d[rows, z]
    with np.errstate(all="ignore"):
        sx, sy, sz = d[rows, x] / along, d[rows, y] / along, np.float32(1) / along
        moved = triangles - asked.origin[:, None]
        px = moved[rows, :, x] - sx[:, None] * moved[rows, :, z]
        py = moved[rows, :, y] - sy[:, None] * moved[rows, :, z]
        pz = sz[:, None] * moved[rows, :, z]
        u, v, w = (edge(px[:, j], py[:, j], px[:, i], py[:, i]) for i, j in ((1, 2), (2, 0), (0, 1)))
        det = u + v + w
        t = (u * pz[:, 0] + v * pz[:, 1] + w * pz[:, 2]) / det
    least, most = np.minimum(np.minimum(u, v), w), np.maximum(np.maximum(u, v), w)
    return ((least >= 0) | (most <= 0)) & (det != 0) & (t > 0), t


def edge(px: Floats, py: Floats, qx: Floats, qy: Floats) -> Floats:
    """p_x q_y - p_y q_x."""
    rounded: Floats = px * qy - py * qx
    wide = px.astype(np.float64) * qy - py.astype(np.float64) * qx
    return np.where(rounded == 0, wide.astype(np.float32), rounded)


SHAPES = {
    # How large triangles are, how far from the ray's origin, how far from the world's, and how thin.
    "even": (1.0, 1.0, 0.0, 1.0),
    "small": (0.01, 1.0, 0.0, 1.0),
    "grazing": (10.0, 0.1, 0.0, 0.03),
    "slivers": (1.0, 1.0, 0.0, 1e-3),
    "far": (100.0, 1.0, 1e5, 1.0),
    "farther": (1.0, 1.0, 2e5, 1.0),
    "close to a corner": (1.0, 1e-4, 0.0, 1.0),
    "edges along axes": (1.0, 1.0, 0.0, 1.0),
    "close, edges along axes": (1.0, 1e-3, 0.0, 1.0),
    "in planes of axes": (1.0, 1.0, 0.0, 1.0),
}


def aimed_at_edges(rng: np.random.Generator, shape: str, n: int) -> tuple[Floats, Rays]:
    """n triangles and a ray for each, aimed a few float32 roundings beside a point of an edge, or beside a vertex."""
    spread, away, offset, thin = SHAPES[shape]
    base = rng.normal(size=(n, 3)) * away + offset
    along = rng.normal(size=(n, 3)) * spread
    other = along * rng.random((n, 1)) * (thin < 1) + rng.normal(size=(n, 3)) * spread * thin
    if "edges along axes" in shape:
        along[:, 1:], other[:, 0] = 0, other[:, 0] * rng.integers(0, 2, n)
    if "planes" in shape:
        along[:, 2] = other[:, 2] = 0
    turned = np.argsort(rng.random((n, 3)), axis=1)
    base, along, other = (np.take_along_axis(x, turned, axis=1) for x in (base, along, other))
    corners = np.stack([base, base + along, base + other], axis=1).astype(np.float32)
    if "close" not in shape:
        corners = corners[np.arange(n)[:, None], (np.arange(3) + rng.integers(0, 3, n)[:, None]) % 3]
    origin = (base + rng.normal(size=(n, 3)) * away * 3).astype(np.float32)
    side, part = rng.integers(0, 3, n), rng.random((n, 1)) * (rng.random((n, 1)) > 0.3)
    target = corners[np.arange(n), side] * (1 - part) + corners[np.arange(n), (side + 1) % 3] * part
    way = target - origin
    reach = np.linalg.norm(way, axis=1, keepdims=True)
    beside = rng.normal(size=(n, 3)) * reach * 2.0**-24 * rng.choice([0.3, 1, 4], (n, 1))
    direction = (way + beside) / np.where(rng.random((n, 1)) < 0.5, reach, 1)
    return corners, Rays(origin, direction.astype(np.float32), np.full(n, np.inf, np.float32))
