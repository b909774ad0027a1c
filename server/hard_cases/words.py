"""The words of a cell's counts, and its figures written for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from renderer.hard_cases.cell import FAULTS, WRONG
from server.comparison.figures import write_times, write_value
from server.comparison.metrics import Metric

COUNTS: Mapping[str, str] = {
    "false_hit": "false hits",
    "false_miss": "false misses",
    "wrong_primitive": "wrong triangles",
    "hole": "holes",
    "any_false_hit": "false hits of any",
    "any_false_miss": "false misses of any",
    "self_hit": "self-hits",
    "unexpected": "unexpected",
    "nan": "NaN",
    "cut": "cut off",
    "overrun": "past the bound",
    "edge": "edge",
    "any_edge": "edge of any",
    "differs": "other bits",
    "spawned": "spawned",
}
"""Counts in the order in which tables have them."""
BAD = (*WRONG, *FAULTS)
_ULPS = Metric("t_ulp_max", "Worst t", "ulp", "lower")


def count_name(name: str) -> str:
    """A count's name; one of a later version keeps its own."""
    return COUNTS.get(name, name.replace("_", " "))


def counts_of(cell: Mapping[str, Any]) -> list[str]:
    """The names of a cell's counts, known ones first."""
    others = set(cell) - set(COUNTS) - _FIELDS
    return [*(name for name in COUNTS if name in cell), *sorted(others)]


_FIELDS = {
    *("variant", "label", "family", "seed", "outcome", "sentence", "rays"),
    *("t_ulp_max", "cost", "fitted", "broken"),
}


def write_ulps(value: float) -> str:
    """A number of ulps with three digits."""
    return f"{write_value(_ULPS, value)} ulp"


def write_cost(value: float) -> str:
    """What a ray costs, in ordinary rays."""
    return write_times(value)
