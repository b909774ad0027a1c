"""What a phone lets the shell read beside its frames: counters, clocks and temperatures, its battery, its throttling.

Which files exist depends on the GPU and on what the vendor lets the shell read, so each is tried; none was verified
on a phone. Units are the kernel's own: Hz, micro-amperes, micro-volts, and thousandths or tenths of a degree.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from server.devices.adb import Phone
from server.devices.words import WordError, plain, require_path

_KGSL, _MALI = "/sys/class/kgsl/kgsl-3d0", "/sys/class/misc/mali0/device"
_BATTERY, _THERMAL = "/sys/class/power_supply/battery", "/sys/class/thermal/thermal_zone*"

FILES: dict[str, tuple[str, ...]] = {
    "gpu_busy": (f"{_KGSL}/gpu_busy_percentage", f"{_MALI}/utilization", f"{_MALI}/gpu_loading"),
    "gpu_busy_ticks": (f"{_KGSL}/gpubusy",),
    "gpu_clock": (f"{_KGSL}/gpuclk", f"{_KGSL}/devfreq/cur_freq", "/sys/class/devfreq/*mali*/cur_freq"),
    "gpu_temp": (f"{_KGSL}/temp",),
    "battery_current": (f"{_BATTERY}/current_now",),
    "battery_voltage": (f"{_BATTERY}/voltage_now",),
    "battery_temp": (f"{_BATTERY}/temp",),
}
"""Files by class, the first that can be read is used; a `*` stands for a part of a name."""

ZONES = {"gpu_temp": "gpu", "skin_temp": "skin"}
"""Thermal zones by class: a word in the zone's type. They stand in where no file of FILES does."""

MAX_VALUE = 64
THROTTLED = 1
"""Android's thermal status from which it throttles: `light` (android.os.PowerManager)."""

_FIELDS = ("level", "temperature", "voltage", "status")


def find_counters(phone: Phone) -> tuple[dict[str, str], dict[str, str]]:
    """The readable counter files by class, and why the other classes are unavailable."""
    globs = [glob for files in FILES.values() for glob in files]
    patterns = " ".join([*globs, f"{_THERMAL}/type", f"{_THERMAL}/temp"])
    said = phone.run(f"grep -sHm1 . {patterns}", doing="looking for counters")
    values = dict(_read_line(line) for line in said.stdout.splitlines() if b":" in line)
    found = {name: path for name, globs in FILES.items() for path in _matching(globs, values)[:1]}
    zones = {name: path for name, word in ZONES.items() for path in _zones(word, values)[:1]}
    found = {**zones, **found}
    reason = "no such file, or the shell may not read it"
    return found, {name: reason for name in (*FILES, *ZONES) if name not in found}


def read_condition(phone: Phone) -> dict[str, Any]:
    """Battery (percent, tenths of a degree, mV, Android's status, plugged in), thermal status; None if unknown."""
    said = phone.run("dumpsys battery; dumpsys thermalservice", doing="reading its battery and temperature")
    text = said.stdout.decode(errors="replace")
    battery: dict[str, Any] = {name: _number(rf"^[ \t]*{name}: (-?[0-9]{{1,9}})[ \t\r]*$", text) for name in _FIELDS}
    powered = re.findall(r"^[ \t]*(?:AC|USB|Wireless|Dock) powered: (true|false)[ \t\r]*$", text, re.MULTILINE)
    battery["plugged"] = "true" in powered if powered else None
    return {"battery": battery, "thermal_status": _number(r"^[ \t]*Thermal Status: ([0-9])[ \t\r]*$", text)}


def samples_of(
    counters: Mapping[str, str],
    missing: Mapping[str, str],
    record_samples: Mapping[str, Any],
    record_missing: Mapping[str, Any],
    before: Mapping[str, Any],
    after: Mapping[str, Any],
) -> dict[str, Any]:
    """What is stored beside a run's frames: counters frame by frame, and the phone's condition before and after."""
    statuses = [one["thermal_status"] for one in (before, after) if one["thermal_status"] is not None]
    read = {name: _values(record_samples.get(name)) for name in counters if name in record_samples}
    refused = {name: plain(record_missing[name]) for name in counters if name in record_missing}
    return {
        "counters": {name: {"file": counters[name], "values": values} for name, values in read.items()},
        "unavailable": {**missing, **refused},
        "before": dict(before),
        "after": dict(after),
        "throttled": max(statuses) >= THROTTLED if statuses else None,
    }


def _read_line(line: bytes) -> tuple[str, str]:
    path, _, value = line.partition(b":")
    return path.decode(errors="replace"), plain(value, MAX_VALUE)


def _matching(globs: tuple[str, ...], values: Mapping[str, str]) -> list[str]:
    """Paths with a value, in the order of the globs."""
    return [path for glob in globs for path in sorted(values) if _is_like(path, glob) and values[path]]


def _zones(word: str, values: Mapping[str, str]) -> list[str]:
    kinds = (path for path in sorted(values) if _is_like(path, f"{_THERMAL}/type") and word in values[path].lower())
    temperatures = (path.removesuffix("type") + "temp" for path in kinds)
    return [path for path in temperatures if values.get(path)]


def _is_like(path: str, glob: str) -> bool:
    """Whether a path that the phone named is one that was asked for, and may be sent back to it."""
    pattern = re.escape(glob).replace(r"\*", "[^/]*")
    try:
        return re.fullmatch(pattern, require_path(path)) is not None
    except WordError:
        return False


def _number(pattern: str, text: str) -> int | None:
    found = re.search(pattern, text, re.MULTILINE)
    return None if found is None else int(found[1])


def _values(sample: Any) -> list[int | str | None]:
    values = sample.get("values") if isinstance(sample, dict) else None
    return [_value(value) for value in values] if isinstance(values, list) else []


def _value(value: Any) -> int | str | None:
    text = "" if value is None else plain(value, MAX_VALUE)
    return int(text) if re.fullmatch(r"-?[0-9]{1,15}", text, re.ASCII) else text or None
