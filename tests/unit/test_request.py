"""What a request accepts, what it says when it refuses, and its JSON form."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from renderer.build.tree import SahCosts
from renderer.request import Request, RequestError, parse_size
from renderer.variant import Variant, VariantError
from scenes.scene import Camera

FULL = Request(
    scene="forest:5000",
    variant=Variant("kd-backtrack", "hybrid", "split", box="williams"),
    size=(640, 480),
    frames=12,
    rounds=4,
    rays="shadow",
    costs=SahCosts(1.0, 2.0),
    check="oracle",
    vs_embree=True,
    specialise=False,
    camera=Camera((1.0, 2.0, 3.0), (0.0, 0.5, 0.0), 50.0, (0.0, 0.0, 1.0)),
    threads=2,
    models=True,
)


@pytest.mark.parametrize("request_", [Request("cornell-box"), FULL], ids=["defaults", "full"])
def test_json_round_trip(request_: Request) -> None:
    text = json.dumps(request_.to_json())
    again = Request.from_json(json.loads(text))
    assert again == request_
    assert again.key == request_.key


def test_missing_keys_take_their_defaults() -> None:
    assert Request.from_json({"scene": "cornell-box"}) == Request("cornell-box")
    assert Request.from_json({"scene": "x", "variant": {"method": "compute"}}).variant == Variant(method="compute")


@pytest.mark.parametrize(
    "change",
    [
        {"scene": "other"},
        {"size": (641, 480)},
        {"variant": Variant("kd-backtrack", "hybrid", "normal")},
        {"costs": SahCosts(1.0, 2.5)},
        {"camera": None},
        {"specialise": True},
        {"models": False},
    ],
    ids=str,
)
def test_the_key_tells_requests_apart(change: dict[str, Any]) -> None:
    assert replace(FULL, **change).key != FULL.key


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"size": (0, 64)}, "The width is 0: give a whole number from 1 to 4096."),
        ({"size": (64, 100_000)}, "The height is 100000: give a whole number from 1 to 4096."),
        ({"frames": 0}, "The frames is 0: give a whole number from 1 to 10000."),
        ({"frames": 3, "rounds": 4}, "The rounds is 4: give a whole number from 1 to 3."),
        ({"threads": 65}, "The threads is 65: give a whole number from 1 to 64."),
        ({"rays": "all"}, "Unknown rays 'all': choose one of primary, shadow, both."),
        ({"check": "embree"}, "Unknown check 'embree': choose one of none, oracle, referee, image."),
        ({"costs": SahCosts(0.0, 1.5)}, "The SAH traversal cost is 0.0: give a number from 1e-6 to 1e6."),
        ({"costs": SahCosts(3.0, math.nan)}, "The SAH intersection cost is nan: give a number from 1e-6 to 1e6."),
        ({"costs": SahCosts(math.inf, 1.5)}, "The SAH traversal cost is inf: give a number from 1e-6 to 1e6."),
        (
            {"variant": Variant(method="hybrid"), "rays": "primary"},
            "bvh-stack hybrid normal is refused: hybrid rasterises what the eye sees and casts no primary rays: "
            "time shadow or both.",
        ),
        (
            {"variant": Variant("kd-push-down", builder="median")},
            "kd-push-down fragment normal median is refused: "
            "median is a BVH builder: a KD-tree is built with sah or clipped.",
        ),
        (
            {"variant": Variant(layout="dense")},
            "Unknown layout 'dense': choose one of normal, compact, split.",
        ),
    ],
    ids=lambda value: "" if isinstance(value, str) else str(value),
)
def test_a_request_that_cannot_be_measured_says_why(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(RequestError) as raised:
        Request("cornell-box", **options)
    assert str(raised.value) == sentence


def test_json_with_an_unknown_value_is_an_error() -> None:
    with pytest.raises(VariantError, match="Unknown traversal 'bvh8'"):
        Request.from_json({"scene": "cornell-box", "variant": {"traversal": "bvh8"}})


@pytest.mark.parametrize(
    ("text", "size"), [("512", (512, 512)), ("640x480", (640, 480)), ("7X5", (7, 5)), (" 8 x 9 ", (8, 9))]
)
def test_sizes_are_read(text: str, size: tuple[int, int]) -> None:
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "x", "12x", "1x2x3", "-4", "4.5", "wide"])
def test_sizes_that_are_not_understood(text: str) -> None:
    with pytest.raises(RequestError, match="is not understood: write it as 512 or 640x480"):
        parse_size(text)
