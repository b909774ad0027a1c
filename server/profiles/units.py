"""Units in one spelling, whatever the profiler writes. Values are never scaled: a unit keeps its prefix."""

from __future__ import annotations

import re

SPELLINGS = {
    "B": "b byte bytes",
    "KB": "kb kilobyte kilobytes",
    "MB": "mb megabyte megabytes",
    "GB": "gb gigabyte gigabytes",
    "bit": "bit bits",
    "ns": "ns nanosecond nanoseconds",
    "us": "us µs μs microsecond microseconds",
    "ms": "ms msec millisecond milliseconds",
    "s": "s sec second seconds",
    "Hz": "hz hertz",
    "KHz": "khz kilohertz",
    "MHz": "mhz megahertz",
    "GHz": "ghz gigahertz",
    "%": "% percent percentage",
    "mW": "mw milliwatt milliwatts",
    "W": "w watt watts",
    "V": "v volt volts",
    "A": "ampere amperes",
    "C": "°c celsius",
    "vertex": "vertex vertices",
    "pixel": "pixel pixels",
    "triangle": "triangle triangles",
    "primitive": "primitive primitives",
    "fragment": "fragment fragments",
    "instruction": "instruction instructions",
    "cycle": "cycle cycles clocks",
    "frame": "frame frames",
}
UNIT_OF = {spelling: unit for unit, spellings in SPELLINGS.items() for spelling in spellings.split()}

# perfetto.protos.GpuCounterDescriptor.MeasureUnit; `gpu_counter_track.unit` of older versions holds its numbers.
PERFETTO = (
    *("", "bit", "kbit", "Mbit", "Gbit", "Tbit", "Pbit", "B", "KB", "MB", "GB", "TB", "PB"),
    *("Hz", "KHz", "MHz", "GHz", "THz", "PHz", "ns", "us", "ms", "s", "min", "h", "vertex", "pixel", "triangle"),
    *("mW", "W", "kW", "J", "V", "A", "C", "F", "K", "%", "primitive", "fragment", "instruction"),
)
_NUMBERS = re.compile(r"\d+(:\d+)*(/\d+(:\d+)*)?")
_ENDING = re.compile(r"\s*\(([^()]*)\)$")


def read_unit(text: str) -> str | None:
    """A unit in our spelling, `Bytes / Second` as `B/s`; one that is not known stays as it is; None for no text."""
    text = text.strip()
    if _NUMBERS.fullmatch(text):
        return _read_numbers(text)
    return known_unit(text) or text or None


def known_unit(text: str) -> str | None:
    """A unit in our spelling, None when it is not known."""
    parts = [[UNIT_OF.get(word.strip().casefold()) for word in side.split(":")] for side in text.split("/")]
    if len(parts) > 2 or not all(all(side) for side in parts):
        return None
    return "/".join(":".join(word for word in side if word) for side in parts)


def split_unit(text: str) -> tuple[str, str | None]:
    """A metric's name without the unit at its end, `SP Memory Read (Bytes)`, and that unit.

    Names that are a share say so by their first or last character, `% Time ALUs Working`, and keep it.
    """
    ending = _ENDING.search(text)
    unit = known_unit(ending[1]) if ending else None
    if ending and unit:
        return text[: ending.start()], unit
    return text, "%" if text.startswith("%") or text.endswith("%") else None


def _read_numbers(text: str) -> str | None:
    sides = [[_numbered(number) for number in side.split(":")] for side in text.split("/")]
    written = [":".join(unit for unit in side if unit) for side in sides]
    return "/".join(side for side in written if side) or None


def _numbered(number: str) -> str:
    return PERFETTO[int(number)] if len(number) < 3 and int(number) < len(PERFETTO) else number
