"""An image made in tiles, and a plan that went through a file, are the same image."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import catalogue_scene, picture, prepared, ready, run_plan

from renderer.judge.accuracy import identical
from renderer.plan import Plan, load_plan
from renderer.prepare import Prepared
from renderer.variant import AXES, Variant

SIZE = (150, 70)
TILE = (64, 32)


def statue(method: str, traversal: str = "bvh-stack", rays: str = "both") -> Prepared:
    return prepared(catalogue_scene("cornell-statue:2000"), Variant(traversal, method), SIZE, rays=rays)


def tiled(plan: Plan) -> Plan:
    """The plan in smaller tiles, its records' buffer as large as one of them."""
    share = TILE[0] * TILE[1] / (plan.tile[0] * plan.tile[1])
    buffers = [replace(b, nbytes=round(b.nbytes * share)) if b.name == "records" else b for b in plan.buffers]
    return replace(plan, tile=TILE, buffers=tuple(buffers))


@pytest.mark.parametrize("traversal", ["brute-force", "bvh-stack"])
@pytest.mark.parametrize("method", AXES["method"])
def test_tiles_make_the_same_records_and_image(method: str, traversal: str) -> None:
    plan = statue(method, traversal).plan(instrument=True)
    rasterised = method == "hybrid"
    whole, parts = (run_plan(one, 1, rasterised=rasterised) for one in (plan, tiled(plan)))
    np.testing.assert_array_equal(whole.image, parts.image)
    assert identical(whole.records, parts.records).first == {}
    np.testing.assert_array_equal(whole.records.primary_counts, parts.records.primary_counts)
    np.testing.assert_array_equal(whole.records.shadow_counts, parts.records.shadow_counts)


@pytest.mark.parametrize("method", AXES["method"])
def test_setup_passes_run_in_tiles(method: str) -> None:
    plan = statue(method, rays="shadow").plan(instrument=False)
    np.testing.assert_array_equal(picture(tiled(plan)), picture(plan))


@pytest.mark.parametrize("method", AXES["method"])
def test_a_plan_from_a_file_makes_the_same_image(method: str, tmp_path: Path) -> None:
    plan = statue(method).plan(instrument=False)
    plan.save(tmp_path / "statue.plan")
    np.testing.assert_array_equal(picture(load_plan(tmp_path / "statue.plan")), picture(plan))


@pytest.mark.parametrize("method", AXES["method"])
def test_frames_repeat(method: str) -> None:
    """Nothing that a frame leaves behind changes the next one; each is timed."""
    with ready(statue(method, rays="shadow").plan(instrument=False)) as twin:
        twin.frame()
        first = twin.image()
        frames = twin.time_frames(3)
        np.testing.assert_array_equal(twin.image(), first)
    assert len(frames.wall) == len(frames.cpu) == 3
    assert all(time > 0 for time in frames.wall)
