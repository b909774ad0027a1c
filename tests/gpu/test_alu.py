"""The ALU model against programs whose blocks were counted on the GPU."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from alu_counting import COUNTING, COUNTING_BINDING, MARKING, executed, place_sites, sites
from hand_made import duplicates, scene
from running import WALKS, catalogue_scene, context, prepared, run_plan

from renderer.alu.compiler import COMPILER, compile_spirv
from renderer.alu.facts import MAIN, counted, facts
from renderer.alu.flow import Fact, Flow, Site, solve
from renderer.alu.marks import Mark
from renderer.alu.model import AluModel, alu_model, operations_of, read_program, tracing_text
from renderer.alu.spirv import read_module
from renderer.glsl import flatten
from renderer.plan import Plan
from renderer.planner import LOOP_BUDGET
from renderer.prepare import Prepared
from renderer.records import Records
from renderer.variant import Variant

UNKNOWN = 0.04
"""How far the model may be from one that knows every loop and every braced branch: what the counters leave open is the
turns of a traversal's outermost loop that end at no leaf."""

# A program, and which of its sites the solver is told.
HAND_MADE = {
    "nested loops and a call": (
        """
uint odd(uint x) {
    uint y = x * 3u;
    if ((x & 1u) == 1u) { SITE(0); y += 5u; } else { SITE(1); y ^= 9u; }
    return y;
}
void main() {
    uint id = gl_GlobalInvocationID.x;
    uint sum = 0u;
    for (uint i = 0u; i < id % 7u; i++) {
        SITE(2);
        uint j = 0u;
        while (j < (id * 5u + i) % 11u) {
            SITE(3);
            sum += odd(j + id);
            j += 1u;
        }
        sum += odd(i);
    }
    if (sum > 40u) { SITE(4); sum = odd(sum); }
    result[id] = sum;
}
""",
        {0, 2, 3, 4},
        {1},
    ),
    "breaks, returns and a switch": (
        """
uint walk(uint x) {
    uint i = 0u;
    while (true) {
        SITE(0);
        if (i > 20u) { SITE(1); return i; }
        i += 1u;
        if (((x + i) & 3u) == 0u) { SITE(2); continue; }
        if (((x ^ i) & 31u) == 7u) { SITE(3); break; }
        SITE(4);
        x = x * 5u + 1u;
    }
    SITE(5);
    return i + 1u;
}
void main() {
    uint id = gl_GlobalInvocationID.x;
    uint found = walk(id);
    switch (found % 3u) {
        case 0u: { SITE(6); found += 1u; break; }
        case 1u: { SITE(7); found += walk(found); break; }
        default: { SITE(8); found *= 2u; }
    }
    result[id] = found;
}
""",
        {0, 2, 3, 6, 7},
        {1, 4, 5, 8},
    ),
}
INVOCATIONS = 4096


@pytest.fixture(autouse=True)
def _compiler() -> None:
    if shutil.which(COMPILER) is None:
        pytest.skip(f"{COMPILER} is not here: install glslang-tools")


@pytest.mark.parametrize("name", HAND_MADE)
def test_blocks_that_were_not_told_are_found(name: str) -> None:
    body, told, hidden = HAND_MADE[name]
    head = "layout(local_size_x = 64) in;\nlayout(std430, binding = 0) buffer Result { uint result[]; };\n"
    ran = _count(flatten({}, [head + COUNTING + body]), len(told | hidden))
    module = read_module(compile_spirv(flatten({}, [head + MARKING + body]), "compute"))
    where = place_sites(module)
    given = [Fact(f"site {k}", {where[k]: 1.0}, float(ran[k]) / INVOCATIONS) for k in told]
    flow = solve(module.functions, MAIN, given)
    assert flow.residual < 1e-9
    for k in hidden:
        routine, block = where[k]
        assert flow.blocks[routine][block] * INVOCATIONS == pytest.approx(float(ran[k]), abs=1e-4)


def _count(text: str, count: int) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    made = context()
    program = made.compute_shader(text)
    result, counters = made.buffer(bytes(4 * INVOCATIONS)), made.buffer(bytes(4 * count))
    result.bind_to_storage_buffer(0)
    counters.bind_to_storage_buffer(COUNTING_BINDING)
    program.run(INVOCATIONS // 64)
    made.memory_barrier()
    ran = np.frombuffer(counters.read(), np.uint32)
    for one in (program, result, counters):
        one.release()
    return ran


def _modelled(name: str, variant: Variant, size: tuple[int, int], rays: str) -> tuple[Prepared, Plan, Records]:
    shown = catalogue_scene(name)
    ready = prepared(shown, variant, size, rays=rays)
    records = run_plan(ready.plan(instrument=True), len(shown.lights), rasterised=variant.method == "hybrid").records
    return ready, ready.plan(instrument=False), records


@pytest.mark.parametrize("box", ["widened", "williams"])
@pytest.mark.parametrize("traversal", WALKS)
def test_a_traversal_is_within_bounds_of_full_counting(traversal: str, box: str) -> None:
    """Counted blocks are met exactly; the figure is close to one that every source branch was counted for."""
    _compare(*_modelled("forest:4000", Variant(traversal, box=box), (64, 64), "both"))


@pytest.mark.parametrize("rays", ["primary", "shadow"])
@pytest.mark.parametrize("layout", ["normal", "compact"])
def test_what_is_timed_is_what_is_modelled(rays: str, layout: str) -> None:
    _compare(*_modelled("cornell-statue:2000", Variant(layout=layout), (64, 64), rays))


@pytest.mark.parametrize("method", ["compute", "hybrid"])
@pytest.mark.parametrize("traversal", ["brute-force", "bvh-parent-link", "kd-push-down"])
def test_methods_are_modelled(traversal: str, method: str) -> None:
    """The image is no whole number of work groups."""
    _compare(*_modelled("cornell-box", Variant(traversal, method), (60, 44), "both"))


def _compare(ready: Prepared, plan: Plan, records: Records) -> None:
    model = alu_model(plan, ready, records)
    assert model.per_fragment is not None, model.text
    assert model.residual is not None
    assert model.residual < 1e-9
    assert model.per_ray == pytest.approx(model.per_fragment * _pixels(plan) / _rays(ready, records))
    assert sum(model.by_function.values()) == pytest.approx(model.per_fragment)
    assert sum(model.by_kind.values()) == pytest.approx(model.per_fragment)

    ran, where = executed(plan), sites(plan)
    program = read_program(*tracing_text(plan))
    frame = counted(ready, records)
    known = facts(program.graph, program.marks, frame)
    flow = solve(program.graph, MAIN, known)
    _steps_are_met(flow, program.marks["triangles"], frame.steps["triangles"] / frame.runs)
    every = [*known, *(Fact(f"site {k}", {site: 1.0}, float(ran[k]) / frame.runs) for k, site in where.items())]
    full = solve(program.graph, MAIN, every)
    assert full.residual < 1e-9, full.worst
    whole = operations_of(program, full, frame)
    assert model.per_fragment == pytest.approx(whole, rel=UNKNOWN)
    assert model.per_fragment <= whole * (1 + 1e-9), "open loops turn as seldom as they can"


def _pixels(plan: Plan) -> int:
    return plan.size[0] * plan.size[1]


def _rays(ready: Prepared, records: Records) -> int:
    """The rays that are timed, counted from the rays themselves."""
    primary = 0 if records.rasterised or ready.request.rays == "shadow" else len(records.primary)
    return primary + (0 if ready.request.rays == "primary" else len(records.shadow))


def _steps_are_met(flow: Flow, marks: Mapping[Site, Mark], value: float) -> None:
    found = sum(mark.least * flow.blocks[name][block] for (name, block), mark in marks.items())
    assert found == pytest.approx(value, rel=1e-9)


def test_a_box_test_and_a_ray_have_the_operations_counted_by_hand() -> None:
    ready, plan, records = _modelled("cornell-box", Variant("bvh-stack"), (64, 64), "both")
    calls = alu_model(plan, ready, records).per_call
    # Twice a difference and a product of three, smaller and larger corner, their largest and smallest and the
    # stay of three, then the nearer of two, a product and a comparison.
    assert calls["box_hit"] == pytest.approx(2 * 6 + 3 + 3 + 3 + (3 + 2) + 1 + 1 + 1)
    # Reciprocals and what stands still of three, the origin by a factor, and three bits of the octant.
    assert calls["slab_prepare"] == pytest.approx((3 + 3 + 6 + 3) + 3 + (3 + 3 + 3) + (3 + 3 + 3 + 2))


def test_brute_force_in_passes_has_no_counters_to_model() -> None:
    _, _, records = _modelled("cornell-box", Variant("brute-force"), (64, 64), "both")
    ready = prepared(scene("passes", duplicates(LOOP_BUDGET)), Variant("brute-force"), (64, 64))
    model = alu_model(ready.plan(instrument=False), ready, records)
    assert model.per_fragment is None
    assert "in passes" in model.text


def test_counts_that_do_not_fit_give_no_figure() -> None:
    ready, plan, records = _modelled("cornell-box", Variant("kd-backtrack"), (64, 64), "both")
    more = records.primary_counts.copy()
    more[:, 0] += more[:, 0] // 4
    model = alu_model(plan, ready, replace(records, primary_counts=more))
    assert model == AluModel(None, None, model.text)
    assert "do not fit" in model.text


def test_without_the_compiler_the_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    ready, plan, records = _modelled("cornell-box", Variant("bvh-stack"), (64, 64), "both")
    monkeypatch.setenv("PATH", "")
    compile_spirv.cache_clear()
    read_program.cache_clear()
    model = alu_model(plan, ready, records)
    assert model.per_fragment is None
    assert "install the package glslang-tools" in model.text
