"""Baked planes are the exact ones, rounded once, where float64 loses what a difference of products leaves, too."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from renderer.pack.baked import WORDS, bake

SEED = 23


def exact_plane(triangle: np.ndarray[tuple[int, ...], np.dtype[np.float32]], kept: int) -> list[Fraction]:
    a, b, c = ([Fraction(float(value)) for value in corner] for corner in triangle)
    ab, ac = [y - x for x, y in zip(a, b, strict=True)], [y - x for x, y in zip(a, c, strict=True)]
    normal = [ab[i - 2] * ac[i - 1] - ab[i - 1] * ac[i - 2] for i in range(3)]
    assert abs(normal[kept]) >= max(map(abs, normal)) * Fraction(999_999, 1_000_000)
    whole = [normal[kept - 2], normal[kept - 1], -sum(n * x for n, x in zip(normal, a, strict=True))]
    return [value / normal[kept] for value in whole]


def test_planes_are_rounded_once() -> None:
    rng = np.random.default_rng(SEED)
    wide = (10.0 ** rng.uniform(-8, 8, (200, 3, 3)) * rng.choice([-1.0, 1.0], (200, 3, 3))).astype(np.float32)
    slim = rng.random((200, 3, 3)).astype(np.float32)
    slim[:, 2] = slim[:, 1] + 1e-6 * rng.random((200, 3)).astype(np.float32)
    through = rng.standard_normal((200, 3, 3)).astype(np.float32)
    through[:, 2] = -through[:, 1]  # the plane passes the origin
    triangles = np.concatenate([wide, slim, through])
    words = bake(triangles, None).reshape(-1, WORDS)
    for triangle, row in zip(triangles, words, strict=True):
        for value, got in zip(exact_plane(triangle, int(row[3] & 3)), row[:3].view(np.float32), strict=True):
            assert abs(Fraction(float(got)) - value) <= abs(value) * Fraction(1001, 1000) / 2**24 + Fraction(1, 2**140)
