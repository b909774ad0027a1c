"""A traversal adds no error of its own, on real scenes: bit for bit against brute force, or against each other."""

from __future__ import annotations

from functools import cache

import pytest
from running import WALKS, Run, catalogue_scene, run

from renderer.judge.accuracy import identical
from renderer.variant import TRAVERSALS, Variant

SMALL = {"cornell-box": (256, 256), "crytek-sponza": (64, 64)}
LARGE = ("crytek-sponza", "forest", "cornell-buddha")
SIDE = (128, 128)
LOST = 1e-3
"""The share of rays that Williams' test may lose before something else must be wrong."""


@cache
def brute(name: str) -> Run:
    return run(catalogue_scene(name), Variant("brute-force", "compute"), SMALL[name])


@cache
def walked(name: str, traversal: str) -> Run:
    # Eight orders of the Buddha's nodes fit into one block in 16 bits only.
    nodes = "grid16" if TRAVERSALS[traversal].nodes in ("skip-octants", "skip-wide") else "f32"
    return run(catalogue_scene(name), Variant(traversal, nodes=nodes), SIDE)


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("name", SMALL)
def test_a_walk_finds_what_brute_force_finds(name: str, traversal: str) -> None:
    found = run(catalogue_scene(name), Variant(traversal, "compute"), SMALL[name]).records
    assert not found.cut.any()
    assert len(found.shadow) > len(found.primary) / 2
    assert identical(found, brute(name).records).first == {}


@pytest.mark.parametrize("traversal", WALKS)
@pytest.mark.parametrize("name", SMALL)
def test_what_williams_loses_is_counted(name: str, traversal: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = run(catalogue_scene(name), Variant(traversal, "compute", box="williams"), SMALL[name]).records
    lost = identical(found, brute(name).records)
    with capsys.disabled():
        print(f"\nwilliams, {name}, {traversal}: {lost.primitive} of {len(found.primary)} rays, {lost.shadow} shadows")
    assert lost.rays == 0
    assert lost.primitive <= LOST * len(found.primary)
    assert lost.shadow <= LOST * len(found.shadow)


@pytest.mark.parametrize("traversal", WALKS[1:])
@pytest.mark.parametrize("name", LARGE)
def test_walks_agree_with_each_other(name: str, traversal: str) -> None:
    found, first = walked(name, traversal).records, walked(name, WALKS[0]).records
    assert not found.cut.any()
    assert identical(found, first).first == {}
