"""One variant on one family: the plain document that comes of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from renderer.variant import Variant

Outcome = Literal["ran", "refused", "left out", "crashed", "hung"]

WRONG = (
    "false_hit",
    "false_miss",
    "wrong_primitive",
    "hole",
    "any_false_hit",
    "any_false_miss",
    "self_hit",
    "unexpected",
)
"""Counts of rays answered wrongly."""

FAULTS = ("nan", "cut", "overrun")
"""Counts that must be 0 whatever the variant: answers that are no number, loops ended, bounds passed."""


@dataclass(frozen=True)
class Cell:
    """What came of `rays` rays of a family's case, asked for their closest hits and again for any.

    `false_hit`, `false_miss`, `wrong_primitive`, `edge` as in `renderer.judge.court`; `hole` counts misses of rays that
    must hit by construction, near an edge as well. `any_*` are answers to "any hit". `nan` counts answers that are no
    number, `cut` rays whose loops were ended, `overrun` rays that visited more than their tree's bound, `differs`
    answers whose bits are not those of the reference (bvh-stack, widened boxes, f32 nodes). `self_hit` counts spawned
    rays, of `spawned`, that hit the triangle they left; `unexpected` those that found something where
    nothing is, or the other way round. `t_ulp_max` is the worst t of a right answer, in float32 ulps of the exact t.
    `cost` is the CPU time of a ray over an ordinary ray's in the same scene. `fitted` says whether the specialised
    text gave the same bits. None is what was not measured.
    """

    variant: Variant
    family: str
    seed: int
    outcome: Outcome = "ran"
    sentence: str = ""
    rays: int = 0
    counts: dict[str, int | None] = field(default_factory=dict)
    t_ulp_max: float | None = None
    cost: float | None = None
    fitted: bool | None = None

    def to_json(self) -> dict[str, Any]:
        """One flat row but for `variant`."""
        row = asdict(self)
        counts: dict[str, int | None] = row.pop("counts")
        return row | {"label": self.variant.label, **counts}
