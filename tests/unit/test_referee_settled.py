"""Who is right where the oracle and we disagree: counted for each side, ties left out."""

from __future__ import annotations

import numpy as np
import pytest
from exact_cases import cast

from renderer.judge.accuracy import judge
from renderer.judge.oracle import Oracle
from renderer.records import Hits, Records

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)
ABOVE, ON, DOWN = (0.75, 0.25, 1.0), (0.75, 0.25, 0.0), (0.0, 0.0, -1.0)
NAMES = ("embree_wrong", "embree_edge", "ours_wrong", "both_wrong")


def counts(origins: list[tuple[float, float, float]], primitives: list[int], occluded: list[bool]) -> dict[str, int]:
    """What the judge counts where we say that rays down from `origins` hit `primitives`, and shadow rays `occluded`."""
    rays, n = cast(origins, DOWN), len(origins)
    hits = Hits(np.where(np.array(primitives) < 0, np.inf, 1).astype(np.float32), np.array(primitives, np.int32))
    row = np.arange(n, dtype=np.int32)
    none = np.zeros((n, 5), np.uint32)
    cut = np.zeros(n, np.bool_)
    records = Records((n, 1), rays, hits, rays, row, row * 0, np.array(occluded), none, none, cut)
    return judge(SQUARE, records, Oracle(SQUARE), None, "referee").counts


@pytest.mark.parametrize(
    ("origin", "primitive", "expected"),
    [
        (ABOVE, 0, (0, 0, 0, 0)),  # agreed
        ((0.5, 0.5, 1.0), 0, (0, 0, 0, 0)),  # the diagonal is both triangles': a tie whichever Embree finds
        ((0.5, 0.5, 1.0), 1, (0, 0, 0, 0)),
        (ABOVE, 1, (0, 0, 1, 0)),  # not the triangle that is there
        (ABOVE, -1, (0, 0, 1, 0)),
        (ON, -1, (1, 1, 0, 0)),  # Embree counts t = 0
        (ON, 1, (0, 0, 0, 1)),
    ],
)
def test_who_is_right(origin: tuple[float, float, float], primitive: int, expected: tuple[int, ...]) -> None:
    found = counts([origin] * 3, [primitive] * 3, [primitive >= 0] * 3)
    assert tuple(found[name] for name in NAMES) == tuple(3 * n for n in expected)


def test_shadow_rays_are_settled_for_one_side_each() -> None:
    found = counts([ABOVE, ABOVE, ON, ON], [0, 0, -1, -1], [True, False, False, True])
    assert (found["shadow_embree_wrong"], found["shadow_ours_wrong"]) == (1, 1)
    assert found["shadow_mismatch"] + found["shadow_edge"] == found["shadow_ours_wrong"]
