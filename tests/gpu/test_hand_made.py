"""Scenes that are hard on traversals: each walk finds what brute force finds, and the referee agrees."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hand_made import SCENES, duplicates, scene, soup
from running import WALKS, Run, run

from renderer.judge.accuracy import identical, judge
from renderer.variant import Variant
from scenes.scene import Scene

SIZE = (33, 31)
ODD_SIZES = ((1, 1), (7, 5), (100, 60), (520, 8))


@cache
def made(name: str) -> Scene:
    return SCENES[name]()


@cache
def brute(name: str) -> Run:
    return run(made(name), Variant("brute-force", "compute"), SIZE)


@pytest.mark.parametrize("method", ["fragment", "compute"])
@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("name", SCENES)
def test_a_walk_finds_what_brute_force_finds(name: str, traversal: str, method: str) -> None:
    walked = run(made(name), Variant(traversal, method), SIZE)
    assert not walked.records.cut.any()
    assert identical(walked.records, brute(name).records).first == {}
    np.testing.assert_array_equal(walked.image, brute(name).image)


@pytest.mark.parametrize("name", SCENES)
def test_brute_force_is_the_same_in_both_methods(name: str) -> None:
    drawn = run(made(name), Variant("brute-force", "fragment"), SIZE)
    assert identical(drawn.records, brute(name).records).first == {}


@pytest.mark.parametrize("name", SCENES)
def test_the_referee_agrees(name: str) -> None:
    errors = judge(made(name).triangles, brute(name).records, None, None, "referee")
    wrong = {kind: errors.counts[kind] for kind in ("false_hit", "false_miss", "wrong_primitive", "shadow_mismatch")}
    assert not any(wrong.values()), errors.counts


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("size", ODD_SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_odd_sizes(size: tuple[int, int], traversal: str) -> None:
    odd = scene("odd sizes", soup(100, 9))
    plain = run(odd, Variant("brute-force", "compute"), size)
    for method in ("fragment", "compute"):
        walked = run(odd, Variant(traversal, method), size)
        assert identical(walked.records, plain.records).first == {}
        np.testing.assert_array_equal(walked.image, plain.image)


@pytest.mark.parametrize("traversal", ["brute-force", *WALKS])
@pytest.mark.parametrize("number", [2, 200])
def test_of_equal_t_the_smaller_id_is_the_hit(number: int, traversal: str) -> None:
    found = run(scene("duplicates", duplicates(number)), Variant(traversal), (8, 8)).records.hits.primitive
    np.testing.assert_array_equal(found, np.zeros(64))


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_williams_loses_rays_along_an_axis(axis: str) -> None:
    """Where a direction is 0 and a face lies at the origin its test compares NaN; the comparison must show that.

    Every BVH traversal loses the same: where a compiler may turn comparisons round, NaN goes now here, now there.
    """
    scene = made(f"along {axis}")
    found = run(scene, Variant("bvh-stack", "compute", box="williams"), SIZE).records
    lost = identical(found, brute(f"along {axis}").records)
    assert lost.rays == 0
    assert 0 < lost.primitive <= 0.05 * len(found.primary)
    for traversal in ("bvh-parent-link", "bvh-restart-trail"):
        for method in ("compute", "fragment"):
            assert identical(found, run(scene, Variant(traversal, method, box="williams"), SIZE).records).same


def test_what_the_scenes_are_for() -> None:
    """Each property that a scene is named for holds, so that the tests above test it."""
    assert (brute("nothing in view").records.hits.primitive == -1).all()
    assert (brute("inside a cube").records.hits.primitive >= 0).all()
    for axis in range(3):
        ahead = brute(f"along -{'xyz'[axis]}").records.primary.direction
        assert (np.delete(ahead, axis, axis=1) == 0).all(axis=1).any()
        assert ((ahead == 0).sum(axis=1) == 1).sum() > 30
    tiny = np.abs(brute("rays about as still as counts").records.primary.direction[:, :2])
    assert (tiny < 2.0**-80).any()
    assert (tiny > 2.0**-80).any()
    assert (brute("rays all but parallel").records.primary.direction != 0).all(axis=1).any()
