"""Packets find what single rays find, bit for bit: every pixel of every image, whatever its neighbours' rays do."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hand_made import SCENES
from running import PACKETS, Run, catalogue_scene, picture, prepared, run

from renderer.judge.accuracy import identical
from renderer.request import Request, RequestError
from renderer.variant import TRAVERSALS, Variant, refusal

SIZE = (61, 43)
"""No multiple of a packet's sides, so that packets overhang the image."""


@cache
def alone(name: str, **axes: str) -> Run:
    return run(catalogue_scene(name), Variant("bvh-stack", "compute", **axes), SIZE)


@pytest.mark.parametrize("traversal", PACKETS)
@pytest.mark.parametrize("name", ["cornell-statue:2000", "crytek-sponza", "forest:4000"])
@pytest.mark.parametrize("nodes", ["f32", "grid16"])
def test_packets_see_scenes_as_single_rays_do(name: str, traversal: str, nodes: str) -> None:
    found = run(catalogue_scene(name), Variant(traversal, "compute", nodes=nodes), SIZE)
    assert not found.records.cut.any()
    assert identical(found.records, alone(name).records).first == {}
    np.testing.assert_array_equal(found.image, alone(name).image)


AXES = (
    {"layout": "compact"},
    {"layout": "split"},
    {"intersector": "watertight"},
    {"intersector": "baked"},
    {"offset": "bounded"},
    {"box": "williams"},
    {"nodes": "half"},
)


@pytest.mark.parametrize("traversal", PACKETS)
@pytest.mark.parametrize("axes", AXES, ids=lambda axes: "-".join(axes.values()))
def test_packets_share_every_axis(axes: dict[str, str], traversal: str) -> None:
    name, variant = "cornell-statue:2000", Variant(traversal, "compute", **axes)
    if axes.get("box") == "williams" and traversal == "bvh-packet-interval":
        assert "leave it at widened" in (refusal(variant) or "")
        return
    found = run(catalogue_scene(name), variant, SIZE)
    same = identical(found.records, alone(name, **axes).records)
    if axes.get("box") == "williams" or axes.get("nodes") == "half":
        # A box that loses a ray is entered all the same when another ray of the packet enters it.
        assert same.rays == 0
        assert same.hit + same.primitive <= 4
    else:
        assert same.first == {}


IN_CELLS = ("bvh-packet-2x2", "bvh-packet-skip-2x2")
"""These see the scenes in 16-bit boxes, others in floats: a walk of each kind in both."""


@pytest.mark.parametrize(("traversal", "nodes"), [(one, "grid16" if one in IN_CELLS else "f32") for one in PACKETS])
@pytest.mark.parametrize("name", SCENES)
def test_hand_made_scenes_and_several_lights(name: str, traversal: str, nodes: str) -> None:
    """Seen along an axis, a packet's rays stand still along another or do not, and share their place in cells."""
    shown = SCENES[name]()
    found = run(shown, Variant(traversal, "compute", nodes=nodes), SIZE)
    assert identical(found.records, run(shown, Variant("bvh-stack", "compute"), SIZE).records).first == {}


@pytest.mark.parametrize("traversal", PACKETS)
@pytest.mark.parametrize("rays", ["primary", "shadow", "both"])
def test_what_is_timed_shows_the_same(rays: str, traversal: str) -> None:
    shown = catalogue_scene("cornell-statue:2000")
    single, packets = (
        picture(prepared(shown, Variant(one, "compute"), SIZE, rays=rays).plan(instrument=False))
        for one in ("bvh-stack", traversal)
    )
    np.testing.assert_array_equal(packets, single)


@pytest.mark.parametrize("traversal", PACKETS)
def test_a_fetch_is_counted_once_for_all(traversal: str) -> None:
    """So a ray's share of the nodes fetched is small, while it enters as many boxes as before, and some for others.

    Of the boxes that packets without a stack would enter, most are not there to be tested.
    """
    found, single = run(catalogue_scene("crytek-sponza"), Variant(traversal, "compute"), SIZE), alone("crytek-sponza")
    nodes, inner, _, triangles, _ = found.records.primary_counts.mean(axis=0)
    assert nodes < single.records.primary_counts[:, 0].mean() / 2
    left = (0.3, 0.6) if TRAVERSALS[traversal].nodes == "skip-wide" else (0.9, 2.0)
    assert left[0] <= inner / single.records.primary_counts[:, 1].mean() <= left[1]
    assert triangles >= single.records.primary_counts[:, 3].mean() * 0.9


@pytest.mark.parametrize("method", ["fragment", "hybrid"])
def test_other_methods_are_refused_with_the_reason(method: str) -> None:
    with pytest.raises(RequestError, match="a fragment shades one pixel and a packet traces several"):
        Request("cornell-box", Variant(PACKETS[0], method))
