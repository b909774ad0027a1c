"""A 16-bit box seen in cells is entered no later and left no earlier than by its faces, and hardly more often."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from test_round_trip import Words, bits, device_reads, shader

from renderer.pack.fetch import reader
from renderer.pack.grid import CELLS, Grid, grid_over
from renderer.pack.schema import glsl

COUNT = 40_000
SEED = 29
FORMS = [(0, "baked"), (1, "watertight")]
"""Whether boxes are grown for the rays, and an intersector that asks for it."""

Doubles = npt.NDArray[np.float64]


def grid_of(scale: float, offset: float) -> Grid:
    """A scene that is long, flat and away from the origin by `offset` of its size."""
    low = scale * (np.array([-1.0, 0.0, -0.3]) + offset)
    high = low + scale * np.array([2.0, 0.01, 1.0])
    return grid_over(low.astype(np.float32), high.astype(np.float32))


def boxes(rng: np.random.Generator, count: int) -> tuple[Words, Words]:
    """Cells of faces: of every size, some without a width along an axis, and the whole grid."""
    size = (2.0 ** rng.uniform(0, 16, (count, 1)) * rng.random((count, 3))).astype(np.int64)
    size[rng.random((count, 3)) < 0.1] = 0
    low = (rng.random((count, 3)) * (CELLS - np.minimum(size, CELLS))).astype(np.int64)
    high = np.minimum(low + size, CELLS)
    low[0], high[0] = 0, CELLS
    return low.astype(np.uint32), high.astype(np.uint32)


def rays(
    rng: np.random.Generator, grid: Grid, low: Words, high: Words, far: float, length: float, near: float
) -> tuple[Doubles, Doubles]:
    """The share `near` of them begins on a face of their box, the others up to 2^`far` grids away and look at it."""
    count = len(low)
    inside = low + (high - low.astype(np.float64)) * rng.integers(0, 3, (count, 3)) / 2
    point = grid.origin + inside * grid.cell
    away = rng.standard_normal((count, 3)) * 2.0 ** rng.uniform(-16, far, (count, 1)) * grid.cell * CELLS
    away[rng.random(count) < near] = 0.0
    origin = (point + away).astype(np.float32).astype(np.float64)
    goal = point + rng.standard_normal((count, 3)) * grid.cell * rng.integers(0, 2, (count, 1))
    way = np.where(away.any(axis=1, keepdims=True), goal - origin, rng.standard_normal((count, 3)))
    way[rng.random((count, 3)) < 0.1] = 0.0
    way[~way.any(axis=1)] = 1.0
    way *= length / np.abs(way).max(axis=1, keepdims=True)
    return origin, way


def seen(grid: Grid, low: Words, high: Words, origin: Doubles, way: Doubles, grown: int, intersector: str) -> Words:
    """Of each pair: hit and entry in cells, and hit and entry by the points of the faces."""
    parts = [
        *(reader(name, "storage") for name in ("primitives", "baked")),
        glsl("box", "grid16", grid),
        "layout(std430, binding = 3) readonly restrict buffer Given { uvec4 given[]; };\n",
        "common_ray.glsl",
        "layout_bare.glsl",
        "common_slab.glsl",
        "box_widened.glsl",
        f"intersector_{intersector}.glsl",
        "common_begin.glsl",
    ]
    statements = [
        "uvec4 box = given[3u * i];",
        "begin_ray(uintBitsToFloat(given[3u * i + 1u].xyz), uintBitsToFloat(given[3u * i + 2u].xyz), 3.4028235e38);",
        "vec3 lower, upper;",
        "node_box(box, lower, upper);",
        "float entry;",
        "found[i * 4u] = uint(box_hit(lower, upper, entry));",
        "found[i * 4u + 1u] = floatBitsToUint(entry);",
        "lower = grid_point(box.xyz & 0xffffu);",
        "upper = grid_point(box.xyz >> 16);",
        "entry = slab_entry(lower, upper);",
        "found[i * 4u + 2u] = uint(entry <= slab_least(slab_exit(lower, upper), hit_t) * WIDEN);",
        "found[i * 4u + 3u] = floatBitsToUint(entry);",
    ]
    text = shader({"BOX_CELLS": 1, "SLAB_GROWN": grown, "SLAB_ALIKE": 0, "INSTRUMENT": 0}, parts, 4, statements)
    given = np.zeros((len(low), 3, 4), np.uint32)
    given[:, 0, :3] = low | high << 16
    given[:, 1, :3], given[:, 2, :3] = bits(origin), bits(way)
    nothing = np.zeros(4, np.uint32)
    return device_reads(text, [nothing, nothing, nothing, given.ravel()], len(low), 4)


@pytest.mark.parametrize(("grown", "intersector"), FORMS)
@pytest.mark.parametrize("length", [1.0, 1e-20, 1e20, 1e35])
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-9, 0.0), (1e9, 100.0), (1e30, 0.0), (1e-30, 1.0)])
def test_no_box_is_entered_later_in_cells(
    scale: float, offset: float, length: float, grown: int, intersector: str
) -> None:
    if scale / length > 1e38:
        pytest.skip("t is beyond float32")
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    grid = grid_of(scale, offset)
    low, high = boxes(rng, COUNT)
    origin, way = rays(rng, grid, low, high, 20.0 if scale < 1e20 else 0.0, length, 0.5)
    found = seen(grid, low, high, origin, way, grown, intersector)
    hit, by_faces = found[:, 0] != 0, found[:, 2] != 0
    entry, entry_by_faces = (np.ascontiguousarray(found[:, k]).view(np.float32) for k in (1, 3))
    assert by_faces.sum() > COUNT / 10
    assert (hit | ~by_faces).all()
    assert (entry <= entry_by_faces)[by_faces].all()


@pytest.mark.parametrize(("grown", "intersector"), FORMS)
def test_cells_let_few_more_in(grown: int, intersector: str) -> None:
    """Of rays that start as far away as a camera does."""
    rng = np.random.default_rng(SEED)
    grid = grid_of(10.0, 0.0)
    low, high = boxes(rng, COUNT)
    origin, way = rays(rng, grid, low, high, 2.0, 1.0, 0.0)
    found = seen(grid, low, high, origin, way, grown, intersector)
    hits, by_faces = np.count_nonzero(found[:, 0]), np.count_nonzero(found[:, 2])
    assert by_faces < 0.9 * COUNT
    assert hits < 1.002 * by_faces
