"""The paper's four figures of a profile (its section 5), told by the metrics' names and units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from server.store.models import Profile, ProfileMetric

PAPER: dict[str, tuple[str, tuple[str | None, ...]]] = {
    "sp_memory_read": ("SP Memory Read", ("B",)),
    "sp_memory_read_per_s": ("SP Memory Read", ("B/s",)),
    "shader_alu_capacity_utilized": ("% Shader ALU Capacity Utilized", ("%",)),
    "time_alus_working": ("% Time ALUs Working", ("%",)),
    "alu_per_fragment": ("ALU / Fragment", (None, "instruction/fragment")),
}
"""Each figure's name in a result, the metric that it is the mean of, and the units that it may have.

The profiler counts bytes per draw in one mode and per second in the other; the two are not compared.
"""


def paper_figures(profiles: Sequence[Profile]) -> dict[str, Any]:
    """A job's `profile`, the latest import first in `profiles`: every figure is one series' mean in one profile.

    A metric that has several series (instances, processes, captures) there is not averaged over them: it is null, and
    `ambiguous` names it. `imported` says from what, since no host of ours measured these.
    """
    figures: dict[str, Any] = {}
    origins: dict[str, None] = {}
    ambiguous = []
    for key, (name, units) in PAPER.items():
        profile, series = _latest(profiles, name, units)
        chosen = _only(series)
        figures[key] = chosen.mean if chosen else None
        if profile is not None and chosen:
            origins[f"{profile.format} (profile {profile.id})"] = None
        elif series:
            ambiguous.append(key)
    return {**figures, "imported": ", ".join(origins) or None, "ambiguous": ambiguous}


def _latest(
    profiles: Sequence[Profile], name: str, units: tuple[str | None, ...]
) -> tuple[Profile | None, list[ProfileMetric]]:
    for profile in profiles:
        series = [one for one in profile.metrics if _plain(one.name) == _plain(name) and one.unit in units]
        if series:
            return profile, series
    return None, []


def _only(series: Sequence[ProfileMetric]) -> ProfileMetric | None:
    """The one series, or the only one of several that is no instance."""
    whole = [one for one in series if one.instance is None]
    chosen = series if len(series) == 1 else whole
    return chosen[0] if len(chosen) == 1 else None


def _plain(name: str) -> str:
    return "".join(name.split()).casefold()
