"""Studies become jobs, and say what they leave out."""

from __future__ import annotations

from typing import Any

import pytest

from renderer.variant import AXES, TRAVERSALS
from server.studies import STUDIES, Study, StudyError, plan_study, with_changes

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
    study = Study(scenes=("small", "large"), axes={"traversal": "all"}, size=(64, 64))
    planned = plan(study)
    assert [(item["scene"], item["traversal"]) for item in planned.refused] == [("large", "brute-force")]
    named = plan(with_changes(study, axes={"traversal": ["brute-force"]}))
    assert [request.scene for request in named.requests] == ["small", "large"]


def test_every_combination_is_planned_or_refused() -> None:
    axes = dict.fromkeys(AXES, "all")
    planned = plan(Study(scenes=("small",), axes=axes, size=(8, 8)))
    total = 1
    for values in AXES.values():
        total *= len(values)
    assert len(planned.requests) + len(planned.refused) == total
    assert all(item["reason"].endswith(".") for item in planned.refused)


def test_rounds_never_exceed_frames() -> None:
    assert plan(Study(scenes=("small",), frames=1)).requests[0].rounds == 1


def test_a_scene_named_twice_is_measured_once() -> None:
    assert len(plan(Study(scenes=("small", "small"))).requests) == 1


@pytest.mark.parametrize(
    ("study", "words"),
    [
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
