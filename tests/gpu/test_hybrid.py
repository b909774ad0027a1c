"""The rasteriser sees what the rays see, but for silhouettes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hand_made import SCENES
from running import catalogue_scene, run

from renderer.variant import Variant
from scenes.scene import Scene

Flags = npt.NDArray[np.bool_]

SIZE = (120, 90)
SHARE = 0.01
"""Of the pixels, how many may hit in one and miss in the other."""


def made(name: str) -> Scene:
    return SCENES[name]() if name in SCENES else catalogue_scene(name)


def on_an_edge(primitive: npt.NDArray[np.int32]) -> Flags:
    """The pixels with a neighbour that hits another triangle, or none."""
    grid = primitive.reshape(SIZE[1], SIZE[0])
    around = np.pad(grid, 1, mode="edge")
    shifts = [around[y : y + SIZE[1], x : x + SIZE[0]] for y in range(3) for x in range(3)]
    return np.asarray(np.any([shift != grid for shift in shifts], axis=0)).ravel()


@pytest.mark.parametrize("name", ["soup seed 10", "inside a soup", "two lights", "cornell-box", "forest"])
def test_hits_and_distances_are_the_rays(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    cast, drawn = (run(made(name), Variant("bvh-stack", method), SIZE).records for method in ("fragment", "hybrid"))
    seen, hit = drawn.hits.primitive != -1, cast.hits.primitive != -1
    with capsys.disabled():
        print(
            f"\nhybrid, {name}: {(seen != hit).sum()} of {hit.size} pixels are hit by either the ray or the draw alone"
        )
    edge = on_an_edge(cast.hits.primitive)
    assert not ((seen != hit) & ~edge).any()
    assert (seen != hit).mean() <= SHARE
    inner = hit & ~edge
    assert inner.sum() > 50
    np.testing.assert_allclose(drawn.hits.t[inner], cast.hits.t[inner], rtol=1e-3)
    np.testing.assert_array_equal(drawn.primary.direction, cast.primary.direction)
