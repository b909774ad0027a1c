"""Mesa 22 stops an invocation after 65,535 loop iterations: what it stopped is reported, never a wrong answer.

Every ray of these scenes has to meet tens of thousands of triangles. A newer Mesa has no limit and cuts nothing, so
what holds everywhere is tested first: a pixel that is not marked as cut is right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hand_made import duplicates, scene, soup, stacked
from running import WALKS, Run, bvh_of, context, run

from renderer.build.tree import SahCosts
from renderer.instrumented import CutShortError
from renderer.judge.accuracy import identical, judge
from renderer.planner import LOOP_BUDGET, pass_triangles
from renderer.records import Flags
from renderer.request import Request
from renderer.slice import measure
from renderer.twin_host import TwinHost
from renderer.variant import Variant
from scenes.scene import Camera, Scene

SIZE = (8, 8)
LIMIT = 65_535
# Where brute force begins to run in passes, with two lights and with one; and where the limit lies.
PASSES = (LOOP_BUDGET // 3, LOOP_BUDGET // 3 + 1, LOOP_BUDGET // 2, LOOP_BUDGET // 2 + 1)
NUMBERS = (8_000, *PASSES, LIMIT // 2 + 1, LIMIT - 5, LIMIT - 2, LIMIT - 1, LIMIT, LIMIT + 1)
BEYOND = 70_000
SMALL_LEAVES = SahCosts(1e-3, 1e3)


def limited() -> bool:
    return "Mesa 22" in str(context().info["GL_VERSION"])


@cache
def same(number: int) -> Scene:
    """One triangle many times; the first light is before it, the second behind."""
    return scene("same", duplicates(number), lights=((0.3, 2.5, 3.0), (-0.6, 0.2, -2.0)))


@cache
def passed(number: int) -> Scene:
    """A wall behind many half squares that the rays only pass by."""
    return scene("passed", stacked(number), (0.3, 0.7, 4.0), (0.3, 0.7, 0.0), 2.0, lights=((0.3, 0.7, 3.0),))


@dataclass(frozen=True)
class Case:
    """A scene of any number of triangles, and the costs of its trees: which loops do most of the turns."""

    make: Callable[[int], Scene]
    costs: SahCosts = SahCosts()

    def run(self, number: int, traversal: str, method: str) -> Run:
        return run(self.make(number), Variant(traversal, method), SIZE, costs=self.costs)

    def right(self, number: int, found: Run) -> Flags:
        """The pixels with the true hit and all the true shadows."""
        last = len(self.make(number).faces) - 1
        primitive, hidden = (0, [0, 1]) if self.make is same else (last, [0])
        shadows = np.full((64, len(hidden)), -1)
        shadows[found.records.shadow_pixel, found.records.shadow_light] = found.records.occluded
        return np.asarray((found.records.hits.primitive == primitive) & (shadows == hidden).all(axis=1))


CASES = {"same": Case(same), "passed": Case(passed), "passed, small leaves": Case(passed, SMALL_LEAVES)}
each_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def cut(found: Run) -> Flags:
    """The pixels marked as cut, which the records and the image's alpha tell alike."""
    np.testing.assert_array_equal(found.image[..., 3].ravel() == 0, found.records.cut)
    return found.records.cut


@pytest.mark.parametrize("method", ["fragment", "compute"])
@pytest.mark.parametrize("traversal", WALKS)
@each_case
def test_below_the_limit_nothing_is_cut(case: Case, traversal: str, method: str) -> None:
    number = 500 if case.costs == SMALL_LEAVES else 20_000
    found = case.run(number, traversal, method)
    assert not cut(found).any()
    assert case.right(number, found).all()


@pytest.mark.parametrize("traversal", WALKS)
@each_case
@pytest.mark.parametrize("number", NUMBERS)
def test_what_is_not_marked_as_cut_is_right(number: int, case: Case, traversal: str) -> None:
    found = case.run(number, traversal, "compute")
    assert (cut(found) | case.right(number, found)).all()


@pytest.mark.parametrize("method", ["fragment", "compute"])
@pytest.mark.parametrize("traversal", WALKS)
@each_case
def test_beyond_the_limit_every_pixel_is_marked(case: Case, traversal: str, method: str) -> None:
    found = case.run(BEYOND, traversal, method)
    assert (cut(found) == limited()).all()
    assert (cut(found) | case.right(BEYOND, found)).all()


@pytest.mark.parametrize("method", ["fragment", "compute"])
@pytest.mark.parametrize("case", [CASES["same"], CASES["passed"]], ids=["same", "passed"])
@pytest.mark.parametrize("number", [*NUMBERS, BEYOND])
def test_brute_force_is_never_cut(number: int, case: Case, method: str) -> None:
    found = case.run(number, "brute-force", method)
    assert not cut(found).any()
    assert case.right(number, found).all()


def test_brute_force_in_passes_gives_the_referee_s_answers() -> None:
    made = scene("large soup", soup(BEYOND, 31, size=0.05), fov=15.0)
    plain = run(made, Variant("brute-force"), SIZE)
    assert sum(step.name.startswith("primary-") for step in plain.plan.passes) == -(-BEYOND // pass_triangles(made))
    errors = judge(made.triangles, plain.records, None, bvh_of(made), "referee")
    wrong = ("false_hit", "false_miss", "wrong_primitive", "shadow_mismatch")
    assert [errors.counts[kind] for kind in wrong] == [0, 0, 0, 0]
    assert errors.counts["hits"] == 64
    walked = run(made, Variant("bvh-stack"), SIZE)
    assert identical(plain.records, walked.records).first == {}
    drawn = run(made, Variant("brute-force", "hybrid"), SIZE).records
    np.testing.assert_array_equal(drawn.hits.primitive != -1, plain.records.hits.primitive != -1)


@pytest.mark.parametrize("traversal", WALKS)
def test_a_run_that_was_cut_is_refused(traversal: str, tmp_path: Path) -> None:
    if not limited():
        pytest.skip("this Mesa does not stop loops")
    path = tmp_path / "same.ply"
    made = same(BEYOND)
    trimesh.Trimesh(made.vertices, made.faces, process=False).export(path)
    camera = Camera((0.4, 0.5, 3.0), (0.5, 0.5, 0.5), 40.0)
    request = Request(str(path), Variant(traversal), SIZE, frames=2, rounds=2, check="none", camera=camera)
    with pytest.raises(CutShortError, match="64 pixels were cut short"):
        measure(request, 0, TwinHost(1))
    # A later round makes no records: the image alone must tell.
    with pytest.raises(CutShortError, match="64 pixels were cut short"):
        measure(request, 1, TwinHost(1))
