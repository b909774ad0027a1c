"""The same plan on the twin and on the phone agent, which runs its shipped DEX over llvmpipe: bit for bit the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from agent_desktop import Batch
from running import catalogue_scene, picture, prepared, ready

from renderer.plan import Plan
from renderer.variant import AXES, Variant, matrix

SIZE = (96, 64)
TILE = (32, 24)
SCENES = ("cornell-box", "cornell-statue:2000")
VARIANTS, _ = matrix({axis: AXES[axis] for axis in ("traversal", "method", "layout")})
TEXTURES, _ = matrix(
    {"traversal": ("bvh-stack", "kd-short-stack"), "method": AXES["method"], "fetch": ("texture", "image")}
)


@pytest.fixture(scope="module")
def agent() -> Iterator[Batch]:
    with Batch() as batch:
        yield batch


def tiled(plan: Plan) -> Plan:
    """The plan in small tiles, its records' buffer as large as one of them."""
    share = TILE[0] * TILE[1] / (plan.tile[0] * plan.tile[1])
    buffers = [replace(b, nbytes=round(b.nbytes * share)) if b.name == "records" else b for b in plan.buffers]
    return replace(plan, tile=TILE, buffers=tuple(buffers))


def same_tiles(agent: Batch, plan: Plan) -> None:
    with ready(plan) as twin:
        expected = twin.collect()
    found = agent.run(plan)
    assert (found.outcome, found.reason) == ("done", None)
    assert [blob.tile for blob in found.blobs] == [tile for tile, _ in expected]
    assert {blob.name for blob in found.blobs} == {"records"}
    for blob, (tile, words) in zip(found.blobs, expected, strict=True):
        np.testing.assert_array_equal(np.frombuffer(blob.data, "<u4"), words, err_msg=str(tile))


def same_image(agent: Batch, plan: Plan) -> None:
    found = agent.run(plan)
    assert (found.outcome, found.reason) == ("done", None)
    (blob,) = found.blobs
    assert (blob.name, blob.tile) == ("image", (0, 0, *plan.size))
    expected = picture(plan)
    assert len(np.unique(expected[..., 0])) > 20
    np.testing.assert_array_equal(np.frombuffer(blob.data, np.uint8).reshape(expected.shape), expected)


@pytest.mark.parametrize("variant", [*VARIANTS, *TEXTURES], ids=lambda variant: variant.label.replace(" ", "-"))
@pytest.mark.parametrize("name", SCENES)
def test_hit_records_and_images_are_identical(agent: Batch, name: str, variant: Variant) -> None:
    plans = prepared(catalogue_scene(name), variant, SIZE)
    same_tiles(agent, tiled(plans.plan(instrument=True)))
    same_image(agent, tiled(plans.plan(instrument=False)))


@pytest.mark.parametrize(
    ("method", "rays"),
    [("fragment", "primary"), ("compute", "primary"), *((method, "shadow") for method in AXES["method"])],
)
def test_plans_that_set_up_first_or_shade_nothing_are_identical(agent: Batch, method: str, rays: str) -> None:
    scene = catalogue_scene("cornell-statue:2000")
    same_image(agent, tiled(prepared(scene, Variant("bvh-stack", method), SIZE, rays=rays).plan(instrument=False)))


@pytest.mark.parametrize("method", AXES["method"])
def test_passes_that_carry_state_are_identical(agent: Batch, method: str) -> None:
    """Brute force over more triangles than a pass may test."""
    scene = catalogue_scene("cornell-statue:32000")
    plans = prepared(scene, Variant("brute-force", method), (16, 8))
    assert len(plans.plan(instrument=False).passes) > 3
    same_tiles(agent, plans.plan(instrument=True))


def test_the_general_form_is_identical(agent: Batch) -> None:
    scene = catalogue_scene("cornell-statue:2000")
    plans = prepared(scene, Variant("kd-backtrack", "hybrid"), SIZE, specialise=False)
    same_tiles(agent, tiled(plans.plan(instrument=True)))


@pytest.mark.parametrize("method", AXES["method"])
def test_a_real_scene_is_identical(agent: Batch, method: str) -> None:
    """Its buffers are uploaded in several chunks."""
    plan = prepared(catalogue_scene("crytek-sponza"), Variant("bvh-stack", method), SIZE).plan(instrument=True)
    assert max(buffer.nbytes for buffer in plan.buffers) > 8 << 20
    same_tiles(agent, tiled(plan))
