"""Every valid variant compiles, runs and shows the same picture; with and without vertex normals."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from running import Image, Run, catalogue_scene, picture, prepared, run, run_plan

from renderer.judge.accuracy import identical
from renderer.variant import AXES, Variant, matrix

SIZE = (48, 40)
SCENES = ("cornell-box", "cornell-statue:2000")
VARIANTS, _ = matrix({axis: AXES[axis] for axis in ("traversal", "method", "layout")})


@cache
def shown(name: str, variant: Variant) -> tuple[Image, Run]:
    """The picture of the timed plan, and the instrumented run."""
    scene = catalogue_scene(name)
    ready = prepared(scene, variant, SIZE)
    rasterised = variant.method == "hybrid"
    timed = picture(ready.plan(instrument=False))
    return timed, run_plan(ready.plan(instrument=True), len(scene.lights), rasterised=rasterised)


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.label.replace(" ", "-"))
@pytest.mark.parametrize("name", SCENES)
def test_each_variant_shows_the_scene(name: str, variant: Variant) -> None:
    image, found = shown(name, variant)
    assert not found.records.cut.any()
    assert (image[..., 3] == 255).all()
    assert len(np.unique(image[..., 0])) > 40
    np.testing.assert_array_equal(image, found.image)
    rasterised = variant.method == "hybrid"
    assert found.records.rasterised == rasterised
    # One picture for all traversals and layouts, and for both methods that cast primary rays.
    first, reference = shown(name, Variant("bvh-stack", "hybrid" if rasterised else "fragment", "normal"))
    np.testing.assert_array_equal(image, first)
    assert identical(found.records, reference.records).first == {}


@pytest.mark.parametrize("method", AXES["method"])
def test_timing_shadow_rays_alone_shows_the_whole_picture(method: str) -> None:
    """The primary rays are cast, or the scene rasterised, once beforehand."""
    np.testing.assert_array_equal(_timing("shadow", method), _timing("both", method))


@pytest.mark.parametrize("method", ["fragment", "compute"])
def test_timing_primary_rays_alone_shows_distances(method: str) -> None:
    """Nothing is shaded, so what the picture shows is the t of the hits themselves."""
    scene = catalogue_scene("cornell-statue:2000")
    t = run(scene, Variant("bvh-stack", method), SIZE).records.hits.t.reshape(SIZE[1], SIZE[0])
    hit = np.isfinite(t)
    shown = _timing("primary", method)[..., 0].astype(float)
    expected = 255 * np.sqrt(scene.diagonal / (scene.diagonal + t[hit]))
    np.testing.assert_allclose(shown[hit], expected, atol=1)
    assert (shown[~hit] < expected.min()).all()


def _timing(rays: str, method: str) -> Image:
    scene = catalogue_scene("cornell-statue:2000")
    return picture(prepared(scene, Variant("bvh-stack", method), SIZE, rays=rays).plan(instrument=False))
