"""Embree's own mistakes, kept so that they can be made again."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest
from exact_cases import FAMILIES, cast, crossing

from renderer.judge.embree_cases import EmbreeCase, embree_cases
from renderer.judge.oracle import Oracle
from renderer.records import Floats

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)


def numbers(written: tuple[str, ...]) -> Floats:
    return np.array([float.fromhex(text) for text in written], np.float32)


def test_a_ray_that_starts_on_a_surface_is_a_case_and_the_others_are_not() -> None:
    origins = np.array([[0.75, 0.25, 1], [0.75, 0.25, 0], [0.5, 0.5, 1], [3, 3, 1]])
    (case,) = embree_cases(SQUARE, cast(origins, (0, 0, -1)), Oracle(SQUARE), None)
    assert (numbers(case.origin).tolist(), numbers(case.direction).tolist()) == ([0.75, 0.25, 0], [0, 0, -1])
    assert (case.embree[0], float.fromhex(case.embree[1])) == (0, 0)
    assert (case.truth, case.edge, case.alone) == ((-1, "inf"), True, True)
    assert numbers(case.triangles[0]).tolist() == SQUARE[0].ravel().tolist()
    assert json.loads(json.dumps(case.to_json()))["reach"] == "inf"


@pytest.mark.parametrize("family", ["vertices at Embree's offset", "whole numbers", "specks"])
def test_kept_cases_are_embree_s_mistakes_in_rationals(family: str) -> None:
    triangles, asked = FAMILIES[family](np.random.default_rng([9, *family.encode()]))
    cases = embree_cases(triangles, asked, Oracle(triangles), None, most=12)
    print(family, len(cases), "cases,", sum(case.alone for case in cases), "alone")
    assert 0 < len(cases) <= 12
    assert any(case.alone for case in cases)
    for case in cases:
        check(case)


def check(case: EmbreeCase) -> None:
    """The referee's answer is the first hit among the kept triangles; Embree's is another, again."""
    few = np.stack([numbers(triangle) for triangle in case.triangles]).reshape(-1, 3, 3)
    ray = cast(numbers(case.origin), numbers(case.direction), numbers((case.reach,)))
    ts = [crossing(triangle, ray.origin[0], ray.direction[0]) for triangle in few]
    hits = [(t, i) for i, t in enumerate(ts) if t is not None and t > 0]
    t, first = min(hits, default=(None, -1))
    assert case.truth[0] == first
    assert t is None or abs(Fraction(float.fromhex(case.truth[1])) - t) <= t * Fraction(2) ** -43
    assert case.embree[0] != first
    if case.alone:
        assert Oracle(few).closest(ray).primitive[0] == case.embree[0]
