"""What is fetched from textures is what is fetched from storage buffers: the same hits, counters and pictures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
import pytest
from running import catalogue_scene, context, prepared, run

from renderer.kept_twins import KeptTwins
from renderer.memory.lines import model_lines
from renderer.pack.fetch import WIDTH, reader, rows
from renderer.plan import Pass, Plan, PlanError, Program, Texture
from renderer.readback import Words
from renderer.records import Records
from renderer.twin import Twin, check_limits
from renderer.twin_host import TwinHost
from renderer.variant import AXES, TRAVERSALS, Variant, matrix

SCENE = "cornell-statue:2000"
SIZE = (40, 24)
MET = ("layout", "nodes", "intersector")
STEP = 7


def variants() -> Iterator[Variant]:
    """Every traversal twice, with others of the values that MET has: those first that none before had."""
    met: set[str] = set()

    def unmet(variant: Variant) -> int:
        return len({getattr(variant, axis) for axis in MET} - met)

    for number, traversal in enumerate(TRAVERSALS):
        methods = ("compute",) if TRAVERSALS[traversal].packet else ("fragment", "compute")
        every = matrix({axis: AXES[axis] for axis in MET} | {"traversal": (traversal,), "method": methods})[0]
        for turn in (0, 1):
            at = STEP * (number + turn) % len(every)
            variant = max(every[at:] + every[:at], key=unmet)
            met.update(getattr(variant, axis) for axis in MET)
            yield variant
    yield Variant("bvh-stack", "hybrid", "split", nodes="grid16")
    yield Variant("kd-short-stack", "hybrid")


def same(first: Records, second: Records) -> bool:
    """Whether two runs' hits, rays and counters are the same words."""
    for part in fields(first):
        one, other = getattr(first, part.name), getattr(second, part.name)
        arrays = vars(one).values() if hasattr(one, "__dict__") else [one]
        others = vars(other).values() if hasattr(other, "__dict__") else [other]
        if not all(np.array_equal(a, b) for a, b in zip(arrays, others, strict=True)):
            return False
    return True


def test_the_variants_have_every_value() -> None:
    for axis in ("traversal", "method", *MET):
        assert {getattr(variant, axis) for variant in variants()} == set(AXES[axis])


@pytest.mark.parametrize("variant", [*variants()], ids=lambda variant: variant.label)
def test_a_texture_gives_what_a_storage_buffer_gives(variant: Variant) -> None:
    scene = catalogue_scene(SCENE)
    stored = run(scene, variant, SIZE)
    for fetch in ("texture", "image"):
        fetched = run(scene, replace(variant, fetch=fetch), SIZE)
        assert same(stored.records, fetched.records)
        assert np.array_equal(stored.image, fetched.image)
        assert max(texture.texels for texture in fetched.plan.textures) > WIDTH
        assert {one.name for one in fetched.plan.buffers} <= {"records", "state", "corners"}


@pytest.mark.parametrize("traversal", [name for name in TRAVERSALS if name != "brute-force"])
def test_the_general_text_fetches_the_same(traversal: str) -> None:
    scene = catalogue_scene(SCENE)
    variant = Variant(traversal, "compute", fetch="image")
    assert same(run(scene, variant, SIZE).records, run(scene, variant, SIZE, specialise=False).records)


@pytest.mark.parametrize("fetch", ["texture", "image"])
@pytest.mark.parametrize("vector", [2, 4])
@pytest.mark.parametrize("texels", [1, WIDTH - 1, WIDTH, WIDTH + 1, 3 * WIDTH, 3 * WIDTH + 5])
def test_every_chunk_is_where_it_is_looked_for(fetch: str, vector: int, texels: int) -> None:
    words = np.random.default_rng(texels).integers(0, 1 << 32, texels * 4, np.uint32)
    found = chunks_read(words, vector, fetch)
    assert np.array_equal(found, words.reshape(-1, vector).sum(axis=1, dtype=np.uint32))
    assert rows(len(words)) == -(-texels // WIDTH)


def chunks_read(words: Words, vector: int, fetch: str) -> Words:
    """The sum of each chunk's words, as a shader reads them."""
    chunks = len(words) // vector
    text = "\n".join(
        [
            "#version 310 es",
            "precision highp float;",
            "layout(local_size_x = 64) in;",
            "layout(std430, binding = 4) writeonly restrict buffer Found { uint found[]; };",
            reader("nodes", fetch, vector),
            f"uint sum(uvec{vector} c) {{ return {' + '.join(f'c.{name}' for name in 'xyzw'[:vector])}; }}",
            "void main() {",
            "    uint i = gl_WorkGroupID.y * 64u + gl_LocalInvocationIndex;",
            f"    if (i < {chunks}u) {{",
            "        found[i] = sum(nodes_at(i));",
            "    }",
            "}",
        ]
    )
    table = Texture("nodes", "rgba32ui", WIDTH, words)
    sampled, loaded = ({"nodes": "nodes"}, {}) if fetch == "texture" else ({}, {"1": "nodes"})
    step = Pass("sum", "compute", "sum", textures=sampled, images=loaded)
    # The image's groups of 8x8 make as many invocations as there are chunks, or more.
    plan = Plan((8, 8 * -(-chunks // 64)), (8, 8 * -(-chunks // 64)), (), (table,), (), (), {}, "nodes", {})
    twin = Twin(context(), replace(plan, programs=(Program("sum", {"compute": text}),), passes=(step,)))
    answer = context().buffer(reserve=chunks * 4)
    answer.bind_to_storage_buffer(4)
    twin.frame()
    found = np.frombuffer(answer.read(), np.uint32)
    answer.release()
    twin.release()
    return found


def test_rows_beyond_the_limit_are_refused() -> None:
    plan = prepared(catalogue_scene(SCENE), Variant("bvh-stack", "compute", fetch="texture"), SIZE).plan(
        instrument=False
    )
    assert plan.needs["TEXTURE_SIZE"] == WIDTH
    assert plan.needs["COMPUTE_SHADER_STORAGE_BLOCKS"] == 0
    device = type("Device", (), {"info": {"GL_MAX_TEXTURE_SIZE": WIDTH - 1}})()
    with pytest.raises(
        PlanError, match=rf"^This device offers GL_MAX_TEXTURE_SIZE = {WIDTH - 1}; the plan needs {WIDTH}\.$"
    ):
        check_limits(device, plan)


def test_plans_share_a_texture_and_the_last_gives_it_back() -> None:
    ready = prepared(catalogue_scene(SCENE), Variant("bvh-stack", "compute", fetch="texture"), SIZE)
    first, second = (ready.plan(instrument=False) for _ in range(2))
    stored = replace(ready, request=replace(ready.request, variant=Variant("bvh-stack", "compute"))).plan(
        instrument=False
    )
    host = KeptTwins(1)
    host._made = context()
    images = [host.measure(plan, 1, lambda: None).image for plan in (first, second, stored)]
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])
    shared = host._held
    assert sorted((kind, one.users) for (kind, _), one in shared.items()) == [
        *(("buffer", 1) for _ in range(2)),
        *(("texture", 2) for _ in range(2)),
    ]
    host.forget(first)
    assert np.array_equal(host.measure(second, 1, lambda: None).image, images[0])
    host.forget(second)
    host.forget(stored)
    assert shared == {}


def test_no_lines_are_modelled_of_a_texture() -> None:
    found = model_lines(prepared(catalogue_scene(SCENE), Variant(fetch="texture"), SIZE), TwinHost(1))
    assert (found.per_ray, found.text) == (
        None,
        "Not modelled: how the texels of a texture lie in memory is the driver's.",
    )
