"""The error of each method on real scenes, against embreex and, where they disagree, the float64 referee."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from running import bvh_of, catalogue_scene, run

from renderer.judge.accuracy import Errors, judge
from renderer.judge.oracle import Oracle
from renderer.records import RASTERISED
from renderer.request import Request
from renderer.slice import measure
from renderer.twin_host import TwinHost
from renderer.variant import Variant

SCENES = ("cornell-box", "crytek-sponza", "forest", "cornell-buddha")
SIDE = (128, 128)
# All traversals give the same hits (test_identity), so one of each structure is judged.
WALKS = ("bvh-stack", "kd-push-down")


@cache
def oracle(name: str) -> Oracle:
    scene = catalogue_scene(name)
    return Oracle(scene.vertices, scene.faces)


@cache
def errors(name: str, traversal: str, method: str) -> Errors:
    scene = catalogue_scene(name)
    records = run(scene, Variant(traversal, method), SIDE).records
    return judge(scene.triangles, records, oracle(name), bvh_of(scene), "referee")


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("name", SCENES)
def test_hits_away_from_edges_are_true(name: str, traversal: str) -> None:
    found = errors(name, traversal, "fragment")
    assert found.counts["hits"] > 0.1 * found.counts["primary"]
    assert found.false_hit is not None
    assert found.false_miss is not None
    assert found.wrong_primitive is not None
    assert found.false_hit + found.false_miss + found.wrong_primitive <= 1e-5, found.counts


@pytest.mark.parametrize("method", ["fragment", "hybrid"])
@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("name", SCENES)
def test_shadows_are_true(name: str, traversal: str, method: str) -> None:
    found = errors(name, traversal, method)
    assert found.counts["shadow"] == found.counts["hits"]
    assert found.shadow_mismatch is not None
    assert found.shadow_mismatch <= 1e-4, found.counts


@pytest.mark.parametrize("name", SCENES)
def test_hybrid_reports_its_visibility_as_the_rasteriser_s(name: str) -> None:
    found = errors(name, "bvh-stack", "hybrid")
    assert (found.false_hit, found.false_miss, found.wrong_primitive, found.edge) == (None, None, None, None)
    assert found.raster_mismatch is not None
    assert 0 <= found.raster_mismatch < 0.05
    records = run(catalogue_scene(name), Variant("bvh-stack", "hybrid"), SIDE).records
    assert set(np.unique(records.hits.primitive)) <= {RASTERISED, -1}


def test_an_image_is_held_against_the_exact_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))
    request = Request("cornell-box", size=(48, 40), frames=1, rounds=1, check="image")
    error = measure(request, 0, TwinHost(1))["error"]
    assert 0 < error["flip"] < 0.05
    assert error["psnr"] > 30
    [kept] = (tmp_path / "pictures").iterdir()
    kept.write_bytes(b"torn")
    assert measure(request, 0, TwinHost(1))["error"] == error
