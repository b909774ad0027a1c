"""A ray crosses a triangle's box at the same bits by the faces that rays of an octant share and by the corners."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from test_round_trip import Words, bits, device_reads, shader

from renderer.pack.fetch import reader

COUNT = 100_000
SEED = 31

Doubles = npt.NDArray[np.float64]


def crossings(corners: Doubles, origin: Doubles, way: Doubles, alike: int) -> Words:
    """Of each triangle (n, 3, 3) and ray the entry and the exit."""
    parts = [
        reader("primitives", "storage"),
        "layout(std430, binding = 3) readonly restrict buffer Given { uvec4 given[]; };\n",
        "common_ray.glsl",
        "layout_bare.glsl",
        "common_slab.glsl",
        "box_widened.glsl",
        "intersector_moller_trumbore.glsl",
        "common_begin.glsl",
    ]
    statements = [
        "begin_ray(uintBitsToFloat(given[5u * i + 3u].xyz), uintBitsToFloat(given[5u * i + 4u].xyz), 3.4028235e38);",
        "vec3 a = uintBitsToFloat(given[5u * i].xyz);",
        "vec3 b = uintBitsToFloat(given[5u * i + 1u].xyz);",
        "vec3 c = uintBitsToFloat(given[5u * i + 2u].xyz);",
        "PRECISE vec3 away = a - slab_origin;",
        "float entry, leave;",
        "slab_cross(a, b, c, away, entry, leave);",
        "found[i * 2u] = floatBitsToUint(entry);",
        "found[i * 2u + 1u] = floatBitsToUint(leave);",
    ]
    defines = {"BOX_CELLS": 0, "SLAB_GROWN": 0, "SLAB_ALIKE": alike, "INSTRUMENT": 0}
    given = np.zeros((len(corners), 5, 4), np.uint32)
    given[:, :3, :3], given[:, 3, :3], given[:, 4, :3] = bits(corners), bits(origin), bits(way)
    nothing = np.zeros(4, np.uint32)
    text = shader(defines, parts, 4, statements)
    return device_reads(text, [nothing, nothing, nothing, given.ravel()], len(corners), 2)


@pytest.mark.parametrize("steps", [2, 1_000_000], ids=["faces meet rays", "nothing meets"])
@pytest.mark.parametrize("scale", [1.0, 1e-20, 1e30])
def test_shared_faces_are_crossed_where_corners_are(scale: float, steps: int) -> None:
    """On a grid of few points rays begin on faces, in planes and on corners, and run within them."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    corners = scale * rng.integers(-steps, steps + 1, (COUNT, 3, 3)) / steps
    origin = scale * rng.integers(-steps, steps + 1, (COUNT, 3)) / steps
    way = rng.integers(-steps, steps + 1, (COUNT, 3)) / steps
    way[~way.any(axis=1)] = 1.0
    by_corners, by_faces = (crossings(corners, origin, way, alike) for alike in (0, 1))
    np.testing.assert_array_equal(by_faces, by_corners)
    entry, leave = (np.ascontiguousarray(by_corners[:, k]).view(np.float32) for k in (0, 1))
    assert COUNT / 50 < np.count_nonzero(entry <= leave) < COUNT
