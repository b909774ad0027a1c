"""Every intersector in every traversal, layout and method: the same hits bit for bit, judged by the referee."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hand_made import SCENES
from running import WALKS, Run, catalogue_scene, prepared, run

from renderer.judge.accuracy import identical, judge
from renderer.pack.baked import WORDS, bake
from renderer.variant import AXES, Variant, matrix
from scenes.scene import Scene

SIZE = (33, 31)
OTHERS = tuple(name for name in AXES["intersector"] if name != "moller-trumbore")
FAR = "far from the origin"
"""Where the baked numbers have lost their digits."""

VARIANTS, _ = matrix({"method": ("fragment", "compute"), "layout": AXES["layout"], "intersector": OTHERS})


@cache
def made(name: str) -> Scene:
    return SCENES[name]()


@cache
def brute(name: str, intersector: str) -> Run:
    return run(made(name), Variant("brute-force", "compute", intersector=intersector), SIZE)


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("intersector", OTHERS)
@pytest.mark.parametrize("name", SCENES)
def test_a_walk_finds_what_brute_force_finds(name: str, intersector: str, traversal: str) -> None:
    walked = run(made(name), Variant(traversal, "compute", intersector=intersector), SIZE)
    assert not walked.records.cut.any()
    assert identical(walked.records, brute(name, intersector).records).first == {}


@pytest.mark.parametrize("intersector", OTHERS)
@pytest.mark.parametrize("name", SCENES)
def test_the_referee_agrees(name: str, intersector: str) -> None:
    errors = judge(made(name).triangles, brute(name, intersector).records, None, None, "referee", intersector)
    wrong = {kind: errors.counts[kind] for kind in ("false_hit", "false_miss", "wrong_primitive", "shadow_mismatch")}
    assert any(wrong.values()) == (intersector == "baked" and name == FAR), errors.counts
    assert intersector == "baked" or errors.counts["edge"] == 0


@cache
def shown(variant: Variant) -> Run:
    return run(catalogue_scene("cornell-statue:2000"), variant, (48, 40))


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.label.replace(" ", "-"))
def test_layouts_and_methods_agree(variant: Variant) -> None:
    first, found = shown(Variant(intersector=variant.intersector)), shown(variant)
    assert identical(found.records, first.records).first == {}
    np.testing.assert_array_equal(found.image, first.image)
    assert len(np.unique(found.image[..., 0])) > 40


@pytest.mark.parametrize("intersector", OTHERS)
@pytest.mark.parametrize("traversal", WALKS[1:])
def test_walks_agree_on_a_real_scene(traversal: str, intersector: str) -> None:
    scene = catalogue_scene("crytek-sponza")
    first, found = (run(scene, Variant(t, intersector=intersector), (96, 96)) for t in (WALKS[0], traversal))
    assert not found.records.cut.any()
    assert identical(found.records, first.records).first == {}


@pytest.mark.parametrize("intersector", OTHERS)
def test_what_williams_loses_is_counted(intersector: str, capsys: pytest.CaptureFixture[str]) -> None:
    lost = []
    for axis in ("+x", "-x", "+y", "-y", "+z", "-z"):
        name = f"along {axis}"
        found = run(made(name), Variant("bvh-stack", "compute", intersector=intersector, box="williams"), SIZE).records
        lost.append(identical(found, brute(name, intersector).records).primitive)
    with capsys.disabled():
        print(f"\nwilliams, {intersector}: {lost} of {SIZE[0] * SIZE[1]} rays along the axes")
    assert 0 < sum(lost) <= 0.05 * 6 * SIZE[0] * SIZE[1]


def test_shadow_rays_alone_use_the_same_test() -> None:
    """Where primary hits are kept in a buffer, baked has one more beside it: four in all, as many as there may be."""
    scene = catalogue_scene("cornell-statue:2000")
    plan = prepared(scene, Variant(intersector="baked"), SIZE, rays="shadow").plan(instrument=False)
    assert plan.needs["FRAGMENT_SHADER_STORAGE_BLOCKS"] == 4


def test_baked_rows_take_triangles_to_the_unit_triangle() -> None:
    """From the words themselves, in float64; a degenerate triangle has coordinates that no point inside has."""
    rng = np.random.default_rng(91)
    triangles = rng.standard_normal((500, 3, 3)).astype(np.float32)
    triangles[7, 2] = triangles[7, 1]
    order = rng.permutation(500).astype(np.int32)
    words = bake(triangles, order).reshape(-1, WORDS)
    rows = words.view(np.float32).astype(np.float64)
    np.testing.assert_array_equal(words[:, 3] >> 2, order)
    for at, (row, kept) in enumerate(zip(rows, words[:, 3] & 3, strict=True)):
        p = triangles[order[at]].astype(np.float64)[:, (int(kept) + np.arange(3)) % 3]
        height = p[:, 0] + p[:, 1:] @ row[:2] + row[2]
        u, v = p[:, 1:] @ row[4:6] + row[6], p[:, 1:] @ row[7:9] + row[9]
        if order[at] == 7:
            assert (u < 0).all()
            continue
        scale = 1e-5 * np.abs(row[4:10]).max()
        np.testing.assert_allclose(height, 0.0, atol=1e-5 * np.abs(row[:3]).max())
        np.testing.assert_allclose(u, [0.0, 1.0, 0.0], atol=scale)
        np.testing.assert_allclose(v, [0.0, 0.0, 1.0], atol=scale)
    np.testing.assert_array_equal(words[:, 10:13].view(np.float32), triangles[order].min(axis=1))
    np.testing.assert_array_equal(words[:, 13:].view(np.float32), triangles[order].max(axis=1))


def test_baked_words_are_counted() -> None:
    scene = catalogue_scene("cornell-statue:2000")
    plain, baked = (prepared(scene, Variant(intersector=name), SIZE).packed for name in ("moller-trumbore", "baked"))
    assert baked.primitives.nbytes - plain.primitives.nbytes == 4 * WORDS * len(scene.faces)
