"""What a job's page says in words: figures, what was not measured and why, and the body that asks for it again."""

from __future__ import annotations

from typing import Any

import pytest
from job_documents import document_of, request_of

from renderer.build.tree import SahCosts
from renderer.request import Request
from renderer.variant import AXES, Variant
from scenes.scene import Camera
from server.api.bodies import JobBody
from server.dashboard.headline import headline, paper_lines
from server.dashboard.result_words import asked_words, environment, left_out
from server.dashboard.waiting import body_again
from server.profiles.paper import PAPER
from server.store.models import Job

ASKED = request_of().to_json()


def line(name: str, asked: dict[str, Any] | None = None, **changes: Any) -> tuple[str, str, bool]:
    """A line of the headline of a result with some fields changed: text, detail, whether it was measured."""
    found = headline({**document_of(phone=False), **changes}, {**ASKED, **(asked or {})})
    [one] = [one for one in found if one.name == name]
    return one.text, one.detail, one.measured


@pytest.mark.parametrize(
    ("name", "asked", "changes", "expected"),
    [
        (
            "Speed",
            {},
            {"frame_ms": {"median": 10.0, "ci_low": None, "ci_high": None}},
            ("0.653 Mray/s", "no interval: that takes 6 frames", True),
        ),
        ("Per CPU second", {}, {"mrays_per_cpu_s": None}, ("not measured", "no CPU time told", False)),
        ("Work per ray", {}, {"per_ray": {}}, ("not measured", "no counters in passes", False)),
        ("Error", {"check": "none"}, {"error": {}}, ("not measured", "submitted without a check", False)),
        ("Error", {}, {"error": {}}, ("not measured", "", False)),
        ("Against Embree", {}, {}, ("not measured", "not asked for", False)),
        ("Against Embree", {"vs_embree": True}, {}, ("not measured", "this device's CPU time is not known", False)),
        (
            "Against Embree",
            {"vs_embree": True},
            {"vs_embree": {"mrays_per_cpu_s": 4.0, "ratio": 0.25}},
            ("0.250 of Embree", "Embree 4 Mray a CPU second, same rays", True),
        ),
        ("Rays", {}, {"rays_timed": None}, ("not measured", "", False)),
        (
            "Rays",
            {},
            {"rays_kind": "shadow", "rays_timed": 3660},
            ("3,660 a frame", "4,096 primary and 3,660 shadow cast, counted; the shadow rays timed", True),
        ),
    ],
)
def test_a_figure_says_what_it_is_or_why_it_is_not(
    name: str, asked: dict[str, Any], changes: dict[str, Any], expected: tuple[str, str, bool]
) -> None:
    assert line(name, asked, **changes) == expected


def test_models_are_labelled_as_such_and_say_how() -> None:
    model = {
        "lines": {"text": "64-byte lines."},
        "alu_per_fragment": 13756.2,
        "alu_per_ray": None,
        "alu_text": "Counted.",
    }
    document = document_of(phone=False)
    found = headline({**document, "model": model, "per_ray": {**document["per_ray"], "lines": 12.25}}, ASKED)
    assert [(one.name, one.text, one.detail) for one in found[-2:]] == [
        ("Cache lines per ray, a model", "12.2", "64-byte lines."),
        ("ALU per fragment, a model", "13,756", "Counted."),
    ]
    assert not any("model" in one.name for one in headline(document, ASKED))


def test_the_environment_says_what_was_not_told() -> None:
    document = document_of(phone=False)
    lines = {
        one.name: (one.text, one.measured) for one in environment({**document, "device": {}, "load_average": None})
    }
    assert (lines["Device"], lines["Load average"]) == (("not told", False), ("not told", False))
    assert lines["Shader hash"] == ("ab" * 32, True)
    assert "Android" not in lines


@pytest.mark.parametrize(
    ("parts", "begins", "listed"),
    [
        (None, "Not specialised", []),
        ([], "Specialised to the scene, which needs all", []),
        (["a", "b"], "Spec", ["a", "b"]),
    ],
)
def test_what_was_left_out_is_said(parts: Any, begins: str, listed: list[str]) -> None:
    sentence, found = left_out({"specialised": parts})
    assert sentence.startswith(begins)
    assert list(found) == listed


def test_the_papers_figures_say_where_several_series_have_them() -> None:
    lines = paper_lines({"time_alus_working": None, "ambiguous": ["time_alus_working"], "sp_memory_read": 13312.0})
    assert len(lines) == len(PAPER)
    assert lines[0].text == "13.3 KB"
    [several] = [one for one in lines if one.detail]
    assert (several.name, several.measured) == ("Time ALUs working", False)


def test_one_of_a_kind_has_no_plural() -> None:
    assert "1 frame in 1 round," in asked_words(Request("forest", frames=1, rounds=1).to_json())


@pytest.mark.parametrize(
    "request_",
    [
        Request("forest"),
        Request(
            "cornell-box",
            Variant("kd-backtrack", "compute", "compact"),
            size=(48, 32),
            frames=5,
            rounds=2,
            rays="primary",
            costs=SahCosts(2.0, 1.5),
            check="oracle",
            vs_embree=True,
            specialise=False,
            camera=Camera((0, 1, 5), (0, 1, 0), 40.0),
        ),
    ],
    ids=["defaults", "everything changed"],
)
def test_the_body_asks_for_the_same_again(request_: Request) -> None:
    body = body_again(Job(request=request_.to_json(), device="P1", priority=7))
    asked = JobBody.model_validate(body)
    assert asked.to_request().to_json() == request_.to_json()
    assert (asked.device, asked.priority) == ("P1", 7)


def test_a_body_has_every_axis_with_its_default_and_its_values() -> None:
    properties = JobBody.model_json_schema()["properties"]
    assert next(iter(properties)) == "scene"
    for axis, default in Variant().as_dict().items():
        assert properties[axis]["default"] == default
        assert tuple(properties[axis]["enum"]) == AXES[axis]
