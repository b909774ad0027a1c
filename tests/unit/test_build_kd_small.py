"""Counting finds the plane that the sweep over events finds."""

from __future__ import annotations

import numpy as np
import pytest
from build_soups import Floats, soup

from renderer.build.kd_events import root_lists
from renderer.build.kd_plane import best_plane
from renderer.build.kd_small import FEW, best_plane_counted
from renderer.build.pad import around


def on_a_grid(boxes: Floats) -> Floats:
    """Faces that many share, and flat boxes among them."""
    return (np.round(boxes * 4) / 4).astype(np.float32)


@pytest.mark.parametrize("seed", range(200))
def test_the_same_plane_is_best(seed: int) -> None:
    rng = np.random.default_rng(seed)
    number = int(rng.integers(1, FEW + 1))
    boxes = soup(number, seed, size=float(rng.choice([0.05, 0.3, 1.0])))
    if seed % 2:
        boxes = on_a_grid(boxes)
    lower, upper = around(boxes)
    traversal = float(rng.choice([0.0, 0.1, 1.0]))
    lists, spans = root_lists(boxes, 2)
    swept = best_plane(lists.pos, lists.code, spans[0], number, lower, upper, traversal, 1.0)
    low, high = (np.ascontiguousarray(boxes[:, side].T) for side in (0, 1))
    counted = best_plane_counted(low, high, number, lower, upper, traversal, 1.0)
    assert counted[:2] == swept[:2]
    axis, plane, flat_left = swept
    if axis < 3 and ((boxes[:, 0, axis] == plane) & (boxes[:, 1, axis] == plane)).any():
        assert counted[2] == flat_left
