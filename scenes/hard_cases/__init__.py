"""Small scenes with rays that are hard on ray tracers, by family (`docs/hard_cases.md`)."""

from __future__ import annotations

from scenes.hard_cases.axes import AXES
from scenes.hard_cases.case import Family, HardCase, Spawned
from scenes.hard_cases.closed import CLOSED
from scenes.hard_cases.degenerate import DEGENERATE
from scenes.hard_cases.scale import SCALE
from scenes.hard_cases.starts import STARTS
from scenes.hard_cases.trees import TREES
from scenes.hard_cases.values import VALUES

__all__ = ["FAMILIES", "Family", "HardCase", "Spawned"]

FAMILIES: dict[str, Family] = {
    family.name: family for family in (*CLOSED, *VALUES, *AXES, *DEGENERATE, *SCALE, *STARTS, *TREES)
}
