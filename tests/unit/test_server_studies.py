"""Studies become jobs, and say what they leave out."""

from __future__ import annotations

import math
from typing import Any

import pytest

from renderer.build.tree import SahCosts
from renderer.variant import AXES, PAPER, TRAVERSALS
from server.named_studies import STUDIES
from server.studies import Study, plan_study, scenes_of, with_changes
from server.study_axes import StudyError

TRIANGLES = {"small": 30, "large": 1_000_000}


def entry(name: str) -> dict[str, Any]:
    return {"name": name, "triangles": TRIANGLES.get(name, 1000)}


def plan(study: Study, here: bool = True) -> Any:
    return plan_study(study, entry, lambda _: here)


def test_the_demo_compares_the_papers_four_with_the_stack_everywhere() -> None:
    planned = plan(STUDIES["demo"])
    pairs = {(request.scene, request.variant.traversal) for request in planned.requests}
    names = {name for name, row in TRAVERSALS.items() if row.paper} | {"bvh-stack"}
    assert pairs == {(scene, name) for scene in ("cornell-box", "forest", "crytek-sponza") for name in names}
    assert all(request.vs_embree and request.check == "referee" for request in planned.requests)
    assert planned.refused == []


def test_the_demo_leaves_out_a_scene_that_is_not_here() -> None:
    assert {request.scene for request in plan(STUDIES["demo"], here=False).requests} == {"cornell-box", "forest"}


def test_the_demos_frames_give_an_interval() -> None:
    assert STUDIES["demo"].frames >= 6


def test_all_leaves_out_brute_force_by_the_number_of_tests() -> None:
    study = Study(scenes=("small", "large"), axes={"traversal": "all", "method": "compute"}, size=(64, 64))
    planned = plan(study)
    assert [(item["scene"], item["traversal"]) for item in planned.refused] == [("large", "brute-force")]
    named = plan(with_changes(study, axes={"traversal": ["brute-force"]}))
    assert [request.scene for request in named.requests] == ["small", "large"]


@pytest.mark.parametrize("traversal", AXES["traversal"])
def test_every_combination_is_planned_or_refused(traversal: str) -> None:
    """Of one traversal: those of all are more slices than a study may have."""
    axes = {axis: "all" for axis in AXES if axis not in ("traversal", "layout", "offset")}
    total = math.prod(len(AXES[axis]) for axis in axes)
    axes["traversal"] = traversal
    planned = plan(Study(scenes=("small",), axes=axes, size=(8, 8), frames=1))
    assert len(planned.requests) + len(planned.refused) == total
    assert all(item["reason"].endswith(".") for item in planned.refused)


def test_rounds_never_exceed_frames() -> None:
    assert plan(Study(scenes=("small",), frames=1)).requests[0].rounds == 1


def test_a_scene_named_twice_is_measured_once() -> None:
    assert len(plan(Study(scenes=("small", "small"))).requests) == 1


def test_every_axis_may_have_several_values() -> None:
    axes = {"traversal": "paper", "size": "8,16x4", "sah": ("3.0,1.5", "1.5,3.0", "3,1.5"), "specialise": "on,off"}
    planned = plan(Study(scenes=("small", "large"), axes=axes))
    assert len(planned.requests) == len(set(planned.requests)) == 2 * 4 * 2 * 2 * 2
    assert {request.size for request in planned.requests} == {(8, 8), (16, 4)}
    assert {request.costs for request in planned.requests} == {SahCosts(3.0, 1.5), SahCosts(1.5, 3.0)}


def test_what_two_parts_ask_for_is_measured_once() -> None:
    parts = ({"method": "all"}, {"layout": "all"}, {"sah": "3.0,1.5; 1.5,3.0"})
    study = Study(scenes=("small",), axes={"method": "fragment"}, parts=parts, repeats=2)
    planned = plan(study)
    assert len(planned.requests) == 2 * (3 + 2 + 1)
    assert len(set(planned.requests)) == 3 + 2 + 1


def test_brute_force_is_measured_once_whatever_the_costs() -> None:
    axes = {"traversal": "brute-force,bvh-stack", "sah": "3.0,1.5; 1.5,3.0"}
    planned = plan(Study(scenes=("small",), axes=axes))
    assert [request.variant.traversal for request in planned.requests].count("brute-force") == 1
    assert len(planned.requests) == 3


def test_all_leaves_out_brute_force_at_the_sizes_that_are_too_large() -> None:
    planned = plan(Study(scenes=("large",), axes={"traversal": "all", "method": "compute", "size": "8,1024"}))
    brute = [request.size for request in planned.requests if request.variant.structure == "none"]
    assert brute == [(8, 8)]
    assert [item["reason"] for item in planned.refused] == [
        "all leaves out brute-force above 10^9 ray-triangle tests a frame; at 1024x1024 they are 2.1e+12."
    ]


def test_the_first_scene_that_is_here_is_taken() -> None:
    study = Study(scenes=("a",), first_here=(("b", "c"), ("d",), ("a", "c")))
    assert scenes_of(study, lambda name: name in "ac") == ["a", "c"]


def test_the_paper_measures_its_figures_with_the_papers_choices() -> None:
    planned = plan(STUDIES["paper"])
    assert {request.scene for request in planned.requests} == {
        *("cornell-box", "cornell-buddha", "fairy-forest", "crytek-sponza")
    }
    four = {name for name, row in TRAVERSALS.items() if row.paper}
    for request in planned.requests:
        assert all(value in PAPER[axis] for axis, value in request.variant.as_dict().items())
        assert (request.models, request.specialise, request.check) == (True, False, "referee")
        assert (request.size, request.rounds, request.frames) == ((1024, 1024), 4, 8)
    forest = [request for request in planned.requests if request.scene == "fairy-forest"]
    changed = {
        (request.variant.method, request.variant.layout, (request.costs.traversal, request.costs.intersection))
        for request in forest
    }
    usual = (3.0, 1.5)
    assert changed == {
        *((method, "normal", usual) for method in AXES["method"]),
        *(("fragment", layout, usual) for layout in AXES["layout"]),
        *(("fragment", "normal", pair) for pair in ((3.0, 1.5), (1.5, 3.0), (2.0, 1.5), (6.0, 1.5))),
    }
    assert {request.variant.traversal for request in forest} == four
    assert len(forest) == len(changed) * len(four)


def test_given_axes_and_fields_replace_a_studys_own_in_every_part() -> None:
    paper = STUDIES["paper"]
    one = plan(with_changes(paper, axes={"traversal": "kd-backtrack"}, costs=SahCosts(1.0, 2.0), size=(8, 8)))
    assert {request.variant.traversal for request in one.requests} == {"kd-backtrack"}
    assert {request.costs for request in one.requests} == {SahCosts(1.0, 2.0)}
    assert {request.variant.layout for request in one.requests} == set(AXES["layout"])
    assert {request.size for request in one.requests} == {(8, 8)}
    assert with_changes(paper, size=None, axes=None) == paper


@pytest.mark.parametrize(
    ("study", "words"),
    [
        (Study(scenes=("small",), axes={"sah": "3.0"}), "write them as 3.0,1.5"),
        (Study(scenes=("small",), axes={"specialise": "maybe"}), "choose one of on, off"),
        (Study(scenes=("small",), axes={"sah": [f"{i},1" for i in range(1, 100_002)]}), "100001 combinations"),
        (Study(scenes=("small",), axes={"method": []}), "axis method has no value"),
        (Study(scenes=("small",), repeats=0), "repeats are 0"),
        (Study(scenes=()), "names no scene"),
        (Study(scenes=("small",), axes={"colour": "red"}), "Unknown axis"),
        (
            Study(scenes=("small",), axes={"traversal": "kd-backtrack", "builder": "median"}),
            "KD-tree is built with sah",
        ),
        (Study(scenes=tuple("abc"), frames=10_000, rounds=10_000), "30000 slices"),
    ],
)
def test_a_study_that_cannot_run_says_why(study: Study, words: str) -> None:
    with pytest.raises(StudyError, match=words):
        plan(study)
