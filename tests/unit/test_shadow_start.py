"""The judge of where shadow rays start: planted self-hits and leaks are counted, and right answers are not."""

from __future__ import annotations

import numpy as np
import pytest
from exact_cases import cast

from renderer.judge.accuracy import judge
from renderer.records import Hits, Rays, Records
from scenes.scene import Point

FLOOR = [[[-9, -9, 0], [9, -9, 0], [0, 9, 0]]]
ROOF = [[[-9, -9, 0.01], [9, -9, 0.01], [-9, 0, 0.01]]]
SCENE = np.array(FLOOR + ROOF, np.float32)
EYE, DOWN = (1.0, 0.5, 4.0), (0.0, 0.0, -1.0)
RIGHT = ("shadow_self_hit", "shadow_blocked", "shadow_leak", "shadow_start_edge")
OPEN, ROOFED, BELOW = (3.0, 2.0, 6.0), (-600.0, -600.0, 1.0), (1.0, 0.5, -3.0)


def judged(start: Point, light: Point, occluded: bool, eye: Point = EYE) -> dict[str, int]:
    """What is counted for one shadow ray from `start`, of a ray straight down that hits the floor."""
    primary = cast([eye], DOWN)
    hits = Hits(np.array([eye[2]], np.float32), np.zeros(1, np.int32))
    way = np.array([light], np.float32) - np.array([start], np.float32)
    shadow = Rays(np.array([start], np.float32), way, np.ones(1, np.float32))
    row, none = np.zeros(1, np.int32), np.zeros((1, 5), np.uint32)
    answer, cut = np.array([occluded]), np.zeros(1, np.bool_)
    records = Records((1, 1), primary, hits, shadow, row, row, answer, none, none, cut)
    counts = judge(SCENE, records, None, None, "referee", lights=(light,)).counts
    return {name: counts[name] for name in RIGHT if counts[name]}


@pytest.mark.parametrize(
    ("start", "light", "occluded", "expected"),
    [
        ((1.0, 0.5, 1e-6), OPEN, False, None),
        ((1.0, 0.5, -1e-6), OPEN, True, "shadow_self_hit"),
        ((1.0, 0.5, 0.0), OPEN, True, "shadow_self_hit"),
        ((1.0, 0.5, 1e-2), OPEN, True, "shadow_blocked"),
        ((1.0, 0.5, 1e-6), ROOFED, True, None),
        ((1.0, 0.5, 0.02), ROOFED, False, "shadow_leak"),
        ((1.0, 0.5, 1e-6), BELOW, True, None),
        ((1.0, 0.5, -1e-6), BELOW, False, "shadow_leak"),
    ],
)
def test_one_start(start: Point, light: Point, occluded: bool, expected: str | None) -> None:
    assert judged(start, light, occluded) == ({} if expected is None else {expected: 1})


def test_starts_are_not_judged_without_lights() -> None:
    rays = cast([EYE], DOWN)
    hits = Hits(np.array([4.0], np.float32), np.zeros(1, np.int32))
    row, none = np.zeros(1, np.int32), np.zeros((1, 5), np.uint32)
    flags = np.zeros(1, np.bool_)
    errors = judge(SCENE, Records((1, 1), rays, hits, rays, row, row, flags, none, none, flags), None, None, "referee")
    assert errors.shadow_self_hit is errors.shadow_leak is None
