"""What a phone told beside its frames, `samples` of a result, as figures in units people read.

The units that the kernel gives are those of `server.devices.counters`; none was verified on a phone.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Json = dict[str, Any]
Value = float | None


@dataclass(frozen=True)
class Kind:
    """A class of counters: its name for people, its unit, and what the kernel's figure is multiplied with."""

    label: str
    unit: str
    scale: float = 1.0


KINDS = {
    "gpu_temp": Kind("GPU temperature", "°C", 1e-3),
    "skin_temp": Kind("Skin temperature", "°C", 1e-3),
    "battery_temp": Kind("Battery temperature", "°C", 0.1),
    "gpu_clock": Kind("GPU clock", "MHz", 1e-6),
    "gpu_busy": Kind("GPU busy", "%"),
    "gpu_busy_ticks": Kind("GPU busy, by its ticks", "%"),
    "battery_current": Kind("Battery current", "mA", 1e-3),
    "battery_voltage": Kind("Battery voltage", "V", 1e-6),
}
"""The classes of `server.devices.counters`, in the order in which they are shown."""

COLUMN_UNITS = {"°C": "c", "MHz": "mhz", "%": "percent", "mA": "ma", "V": "v"}

_TICKS = re.compile(r"\s*(\d{1,18})\s+(\d{1,18})\s*")
_SHARE = re.compile(r"\s*(-?\d{1,15}(?:\.\d{1,9})?)\s*%?\s*")


@dataclass(frozen=True)
class Reading:
    """One class of counters, a value for every frame of the job; None where it was not read.

    `files` are where the phone has it, more than one where its rounds differ.
    """

    name: str
    kind: Kind
    files: tuple[str, ...]
    values: tuple[Value, ...]

    @property
    def column(self) -> str:
        """Its name in a table, with its unit: `gpu_clock_mhz`."""
        return f"{self.name}_{COLUMN_UNITS[self.kind.unit]}"


def read_readings(samples: Sequence[Json], frames: Sequence[int]) -> list[Reading]:
    """The readings of a job's rounds, which have this many frames each; without those of which nothing was read."""
    found = []
    for name, kind in KINDS.items():
        counters = [_counter(sample, name) for sample in samples]
        values = tuple(
            value
            for counter, count in zip(counters, frames, strict=True)
            for value in _round(name, counter.get("values"), count)
        )
        if any(value is not None for value in values):
            files = dict.fromkeys(str(counter["file"]) for counter in counters if "file" in counter)
            found.append(Reading(name, kind, tuple(files), values))
    return found


def read_value(name: str, raw: Any) -> Value:
    """One figure of a class as the kernel wrote it, in the class's unit; None for what is no figure."""
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return raw * KINDS[name].scale
    text = raw if isinstance(raw, str) else ""
    if name == "gpu_busy_ticks":
        ticks = _TICKS.fullmatch(text)
        return 100 * int(ticks[1]) / int(ticks[2]) if ticks and int(ticks[2]) else None
    share = _SHARE.fullmatch(text)
    return float(share[1]) * KINDS[name].scale if share else None


def _counter(sample: Json, name: str) -> Json:
    counter = (sample.get("counters") or {}).get(name)
    return counter if isinstance(counter, dict) else {}


def _round(name: str, raw: Any, count: int) -> list[Value]:
    values = [read_value(name, value) for value in raw[:count]] if isinstance(raw, list) else []
    return values + [None] * (count - len(values))
