"""Real compilers: every traversal and method for the usual GPUs, their totals, and their weights by what is known."""

import pytest
from running import catalogue_scene, prepared

from renderer.phone_compile.counted import Frame, count_frame, tracing_program
from renderer.phone_compile.estimate import Estimate, estimate_all
from renderer.phone_compile.gpus import GPUS, USUAL
from renderer.phone_compile.sites import Where
from renderer.phone_compile.toolchain import MissingError, ToolChain, tool_chain
from renderer.plan import Plan
from renderer.planner import make_plan
from renderer.prepare import Prepared
from renderer.twin_host import TwinHost
from renderer.variant import TRAVERSALS, Variant

SIZE = (40, 32)
"""Work groups overhang neither side, and pixels miss the box."""
SINGLE = [name for name, row in TRAVERSALS.items() if not row.packet]
CASES = [*((traversal, "fragment") for traversal in SINGLE), ("kd-backtrack", "compute"), ("bvh-stack", "hybrid")]


def chain() -> ToolChain:
    try:
        return tool_chain()
    except MissingError as error:
        pytest.skip(str(error))


def ready(traversal: str, method: str, **axes: str) -> tuple[Prepared, Plan]:
    made = prepared(catalogue_scene("cornell-box"), Variant(traversal, method, **axes), SIZE)
    return made, made.plan(instrument=False)


def estimates(made: Prepared, plan: Plan) -> tuple[Frame, list[Estimate]]:
    frame = count_frame(made, plan, TwinHost(1))
    return frame, estimate_all(chain(), [GPUS[name] for name in USUAL], plan, frame)


@pytest.mark.parametrize(("traversal", "method"), CASES)
def test_every_traversal_compiles_and_is_weighed(traversal: str, method: str) -> None:
    """A listing whose totals are not the driver's gives a reason, and so do counts that do not fit its flow."""
    _, found = estimates(*ready(traversal, method))
    for estimate in found:
        assert estimate.reason is None, estimate
        assert estimate.limit is None, estimate
        assert estimate.alu_per_fragment is not None
        assert estimate.memory_per_fragment is not None
        assert estimate.residual is not None
        assert estimate.residual < 1e-6
        assert 0 < estimate.memory_per_fragment < estimate.alu_per_fragment
    loads = {e.gpu: e.per_fragment["memory"] for e in found}
    # Adreno 630 reads word by word; Adreno 740 reads what is the same for a whole draw once.
    assert loads["mali-g57"] == pytest.approx(loads["mali-g72"])
    assert loads["adreno-540"] == pytest.approx(loads["mali-g57"], rel=0.05)
    assert loads["adreno-740"] == pytest.approx(loads["adreno-540"], rel=0.1)
    assert loads["adreno-630"] > 2 * loads["adreno-540"]


@pytest.mark.parametrize("layout", ["normal", "compact"])
def test_loads_are_those_that_the_counters_know(layout: str) -> None:
    """bvh-stack reads 2 chunks a node and a triangle by 3 or 4 chunks; then a surface for each hit, once more."""
    made, plan = ready("bvh-stack", "fragment", layout=layout)
    frame, found = estimates(made, plan)
    program, _ = tracing_program(plan)
    assert program.stages["fragment"].count("primitive_chunk(") > 0
    triangles = sum(frame.sites[Where(1, shadow)] for shadow in (False, True))
    steps = sum(frame.sites[Where(3, shadow)] for shadow in (False, True))
    walks = 3 * triangles + 4 * steps
    rest = {e.gpu: e.per_fragment["memory"] * frame.pixels - walks for e in found if e.gpu != "adreno-630"}
    for gpu, loads in rest.items():
        # The root by each ray, the surface by each hit.
        assert 0 <= loads <= 2 * frame.rays + 4 * frame.pixels, gpu


def test_a_frame_counts_sites_as_rays_are_cast() -> None:
    """Primary rays and shadow rays are told apart, and the budget's loop turns twice for every pixel."""
    made, plan = ready("bvh-parent-link", "compute")
    frame = count_frame(made, plan, TwinHost(1))
    assert frame.pixels == SIZE[0] * SIZE[1] == frame.runs
    assert 2 * frame.pixels in frame.sites.values()
    assert any(where.shadow and count for where, count in frame.sites.items())


def test_a_limit_that_the_plan_does_not_keep_is_named() -> None:
    """Recording what is read takes two buffers more: Qualcomm's driver has four for fragments."""
    made, plan = ready("bvh-stack", "fragment", layout="normal")
    instrumented = make_plan(made.scene, made.tree, made.packed, made.request, instrument=True)
    needs = plan.needs | {"FRAGMENT_SHADER_STORAGE_BLOCKS": 5, "COMPUTE_SHARED_MEMORY_SIZE": 1 << 20}
    assert instrumented.needs["FRAGMENT_SHADER_STORAGE_BLOCKS"] > plan.needs["FRAGMENT_SHADER_STORAGE_BLOCKS"]
    wanting = Plan(**{**plan.__dict__, "needs": needs})
    by_gpu = {e.gpu: e for e in estimate_all(chain(), [GPUS["adreno-540"], GPUS["mali-g72"]], wanting, None)}
    assert by_gpu["adreno-540"].limit == (
        "GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS is 4 in the vendor's driver for adreno-540, and the plan needs 5."
    )
    assert by_gpu["mali-g72"].limit == (
        "GL_MAX_COMPUTE_SHARED_MEMORY_SIZE is 32768 in Mesa's driver for mali-g72, and the plan needs 1048576."
    )


def test_a_text_that_a_gpu_does_not_take_is_told_in_one_sentence() -> None:
    _, plan = ready("bvh-stack", "fragment")
    program, stage = tracing_program(plan)
    program.stages[stage] += "\nvoid broken( {"
    (estimate,) = estimate_all(chain(), [GPUS["mali-g57"]], plan, None)
    assert estimate.instructions is None
    assert estimate.reason is not None
    assert estimate.reason.startswith("mali-g57 does not compile this: its fragment text is refused: ")
    assert "\n" not in estimate.reason
