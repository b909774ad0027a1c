"""Better trees change no hit: bit for bit what the sweep's tree gives, whatever walks them."""

from __future__ import annotations

from functools import cache

import pytest
from running import PACKETS, Run, catalogue_scene, run

from renderer.build.refined import REFINEMENTS
from renderer.judge.accuracy import identical
from renderer.variant import TRAVERSALS, Variant

SIZE = (60, 44)
WALKS = tuple(name for name, row in TRAVERSALS.items() if row.structure == "bvh")
KD_WALKS = tuple(name for name, row in TRAVERSALS.items() if row.structure == "kd")


@cache
def sweep(name: str, intersector: str) -> Run:
    return run(catalogue_scene(name), Variant("bvh-stack", "compute", intersector=intersector), SIZE)


@pytest.mark.parametrize("builder", REFINEMENTS)
@pytest.mark.parametrize("intersector", ["moller-trumbore", "watertight"])
@pytest.mark.parametrize("name", ["cornell-box", "crytek-sponza", "forest:4000"])
def test_a_better_tree_changes_no_hit(name: str, intersector: str, builder: str) -> None:
    variant = Variant("bvh-stack", "compute", intersector=intersector, builder=builder)
    found = run(catalogue_scene(name), variant, SIZE)
    assert not found.records.cut.any()
    assert identical(found.records, sweep(name, intersector).records).first == {}


@pytest.mark.parametrize("traversal", WALKS)
def test_every_walk_takes_triangles_that_are_named_twice(traversal: str) -> None:
    nodes = "grid16" if traversal in PACKETS else "f32"
    found = run(catalogue_scene("crytek-sponza"), Variant(traversal, "compute", nodes=nodes, builder="sbvh"), SIZE)
    assert identical(found.records, sweep("crytek-sponza", "moller-trumbore").records).first == {}


@pytest.mark.parametrize("traversal", KD_WALKS)
@pytest.mark.parametrize("intersector", ["moller-trumbore", "watertight"])
@pytest.mark.parametrize("name", ["cornell-box", "crytek-sponza", "forest:4000"])
def test_a_clipped_tree_changes_no_hit(name: str, intersector: str, traversal: str) -> None:
    found = run(catalogue_scene(name), Variant(traversal, "compute", intersector=intersector, builder="clipped"), SIZE)
    assert not found.records.cut.any()
    assert identical(found.records, sweep(name, intersector).records).first == {}
