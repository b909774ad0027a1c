"""Hard cases on the GPU: what must hold of every variant, on some of the rays; `rayfarm study hard-cases` casts all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from running import PACKETS, WALKS, context

from renderer.hard_cases.asking import Asker
from renderer.hard_cases.measure import measure_cell
from renderer.hard_cases.promises import broken
from renderer.hard_cases.ready import Ready
from renderer.hard_cases.study import few_variants
from renderer.records import Rays
from renderer.variant import TRAVERSALS, Variant
from scenes.hard_cases import FAMILIES

SEED = 11
SHARE = 0.05
SLOW = ("embree-sphere-200", "embree-plane-200")
"""Families whose trees take seconds; the study has them."""
NAMES = tuple(name for name in FAMILIES if name not in SLOW)


@pytest.fixture(scope="module", autouse=True)
def _no_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_CACHE", str(tmp_path_factory.mktemp("trees")))
        yield


@cache
def asker() -> Asker:
    return Asker(context())


@cache
def ready(name: str) -> Ready:
    return Ready(FAMILIES[name], SEED, SHARE)


def rows_of(variant: Variant, names: tuple[str, ...], *, fitted: int = 0) -> list[dict[str, Any]]:
    sample = set(np.random.default_rng([SEED, *variant.label.encode()]).choice(names, fitted, replace=False))
    return [measure_cell(asker(), variant, ready(name), fitted=name in sample, timed=False).to_json() for name in names]


def sampled(variant: Variant, number: int) -> tuple[str, ...]:
    """Some families for a variant, all of them over all the variants."""
    return tuple(np.random.default_rng([SEED, *variant.label.encode()]).choice(NAMES, number, replace=False))


@pytest.mark.parametrize("traversal", [*WALKS, *PACKETS])
@pytest.mark.parametrize("intersector", ["moller-trumbore", "watertight"])
def test_every_walk_keeps_its_promises_on_every_family(intersector: str, traversal: str) -> None:
    variant = Variant(traversal, "compute", intersector=intersector)
    rows = rows_of(variant, NAMES, fitted=2)
    assert broken(rows) == []
    assert sum(row["outcome"] == "ran" for row in rows) == len(NAMES) - 1
    assert [row["sentence"] for row in rows if row["outcome"] == "refused"] == [
        "Some coordinates are not finite numbers; repair the mesh first."
    ]


@pytest.mark.parametrize("variant", few_variants(), ids=lambda variant: variant.label)
def test_every_variant_keeps_its_promises_on_some_families(variant: Variant) -> None:
    assert broken(rows_of(variant, sampled(variant, 6), fitted=1)) == []


@pytest.mark.parametrize("traversal", ["brute-force", *WALKS, *PACKETS])
@pytest.mark.parametrize(
    "name", ["embree-sphere-50", "pbrt-vertices", "pbrt-edges", "shared-diagonal", "whole-terrain"]
)
def test_watertight_has_no_holes(name: str, traversal: str) -> None:
    variant = Variant(traversal, "compute", intersector="watertight")
    cell = measure_cell(asker(), variant, ready(name), timed=False).to_json()
    assert (cell["hole"], cell["false_hit"], cell["false_miss"], cell["cut"]) == (0, 0, 0, 0)


def test_known_losses_are_there() -> None:
    """So that the counts above can fail: the papers' tests lose rays, and the constant offset hits its own triangle."""
    papers = Variant("bvh-stack", "compute")
    vertices = measure_cell(asker(), papers, ready("pbrt-vertices"), timed=False).to_json()
    assert vertices["hole"] > 0
    assert vertices["false_miss"] == 0
    williams = measure_cell(asker(), replace(papers, box="williams"), ready("grid-vertices"), timed=False).to_json()
    assert williams["differs"] > 0
    far = measure_cell(asker(), papers, ready("respawn-far"), timed=False).to_json()
    assert far["self_hit"] > 0
    leak = measure_cell(asker(), papers, ready("leak"), timed=False).to_json()
    assert leak["unexpected"] == leak["spawned"] > 0


@pytest.mark.parametrize("method", ["compute", "fragment"])
@pytest.mark.parametrize("name", ["stadium", "limits", "nearly-still"])
def test_rays_are_cast_as_given_and_answered_alike(name: str, method: str) -> None:
    """Both methods and brute force find the same bits, for the closest hit and for any."""
    rays = ready(name).rays
    answers = {}
    for traversal in ("brute-force", "bvh-stack"):
        setup = asker().set_up(Variant(traversal, method), ready(name))
        answers[traversal] = setup.ask(rays), setup.ask(rays, any_hit=True)
    (closest, occluded), (brute, brute_any) = answers["bvh-stack"], answers["brute-force"]
    for given, cast in ((rays.origin, closest.rays.origin), (rays.direction, closest.rays.direction)):
        np.testing.assert_array_equal(given.view(np.uint32), cast.view(np.uint32))
    np.testing.assert_array_equal(closest.hits.primitive, brute.hits.primitive)
    np.testing.assert_array_equal(closest.hits.t.view(np.uint32), brute.hits.t.view(np.uint32))
    np.testing.assert_array_equal(occluded.hits.primitive >= 0, closest.hits.primitive >= 0)
    np.testing.assert_array_equal(brute_any.hits.primitive >= 0, closest.hits.primitive >= 0)
    assert (closest.counts[:, 0] > 0).all()


@pytest.mark.parametrize("traversal", WALKS)
def test_rays_that_are_none_look_at_one_box(traversal: str) -> None:
    """Whatever the processor's clock says: a NaN or an infinity ends a walk where it begins."""
    for box in ("widened", "williams"):
        setup = asker().set_up(Variant(traversal, "compute", box=box), ready("nan-component"))
        row = TRAVERSALS[traversal]
        end = row.nodes.startswith("skip")  # the node that ends a walk
        beside = end and not row.packet  # the next node in memory
        for name in ("nan-component", "inf-component", "nan-reach", "inf-both", "no-direction"):
            answer = setup.ask(ready(name).rays)
            assert (answer.hits.primitive == -1).all()
            assert answer.counts[:, 0].max() <= (1 + end) * (1 + beside)
            assert answer.counts[:, 1:4].max() <= 1 + end


def test_no_rays_and_one_ray() -> None:
    setup = asker().set_up(Variant("bvh-stack", "compute"), ready("stadium"))
    rays = ready("stadium").rays
    whole = setup.ask(rays)
    assert len(setup.ask(rays[slice(0, 0)]).hits.t) == 0
    for count in (1, 255, 257):
        part = setup.ask(Rays(rays.origin[:count], rays.direction[:count], rays.reach[:count]))
        np.testing.assert_array_equal(part.hits.primitive, whole.hits.primitive[:count])
