"""Stack and trail widths: the general form finds what the fitted one finds, and deep trees are walked to the end."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hand_made import scene, soup
from running import WALKS, Run, prepared, run, run_plan

from renderer.build.chain import chain_bvh
from renderer.judge.accuracy import identical
from renderer.pack.api import pack
from renderer.prepare import Prepared
from renderer.variant import TRAVERSALS, Variant
from scenes.scene import Scene

SIZE = (24, 24)


@cache
def leafy() -> Scene:
    return scene("leafy", soup(400, 21))


@cache
def brute(number: int) -> Run:
    return run(row(number), Variant("brute-force"), SIZE)


@cache
def row(number: int) -> Scene:
    """Triangles in the order of their place along x, so that a chain of nodes over them is a BVH."""
    triangles = soup(number, 22, size=0.8)
    return scene(f"row of {number}", triangles[np.argsort(triangles[:, :, 0].mean(axis=1))])


@pytest.mark.parametrize("rightward", [True, False], ids=["rightward", "leftward"])
@pytest.mark.parametrize("depth", [1, 31, 32, 33, 63, 64])
@pytest.mark.parametrize("traversal", [name for name in WALKS if TRAVERSALS[name].structure == "bvh"])
def test_deep_trees_are_walked_to_the_end(traversal: str, depth: int, rightward: bool) -> None:
    made = row(depth + 1)
    request = prepared(made, Variant(traversal), SIZE).request
    tree = chain_bvh(made.triangles, rightward=rightward)
    plan = Prepared(request, made, tree, None, pack(made, tree, request)).plan(instrument=True)
    walked = run_plan(plan, len(made.lights)).records
    assert not walked.cut.any()
    assert identical(walked, brute(depth + 1).records).first == {}


@pytest.mark.parametrize("traversal", ["brute-force", *WALKS])
def test_the_general_form_finds_what_the_fitted_one_finds(traversal: str) -> None:
    fitted = run(leafy(), Variant(traversal), SIZE)
    general = run(leafy(), Variant(traversal), SIZE, specialise=False)
    assert general.plan.left_out == ()
    assert general.plan.shader_sha != fitted.plan.shader_sha
    assert identical(fitted.records, general.records).first == {}


def test_what_is_fitted_is_named() -> None:
    trail = prepared(leafy(), Variant("bvh-restart-trail"), SIZE)
    assert "the trail's second word" in trail.plan(instrument=False).left_out
    stack = prepared(leafy(), Variant("bvh-stack"), SIZE)
    assert stack.tree is not None
    assert f"{64 - stack.tree.depth} of 64 stack entries" in stack.plan(instrument=False).left_out
