"""What a phone says of itself over its shell, and what this host is. Every text of a phone's is plain and short."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path
from typing import Any

from server.devices.adb import Phone
from server.devices.counters import read_condition
from server.devices.properties import read_properties
from server.devices.words import plain

Facts = dict[str, Any]

_CHARGING = {2: "charging", 3: "discharging", 4: "not charging", 5: "full"}
_THERMAL = ("none", "light", "moderate", "severe", "critical", "emergency", "shutdown")
"""Android's thermal status by number (android.os.PowerManager)."""


def describe_phone(serial: str) -> Facts:
    """Model, SoC, Android, battery and thermal status; raise DeviceGoneError or PhoneError."""
    phone = Phone(serial)
    properties = read_properties(phone)
    built = phone.run('getprop "$1"', "ro.build.fingerprint", doing="saying how its system was built")
    name = _joined(properties["manufacturer"], properties["model"]) or serial
    return {"name": name, **properties, "fingerprint": plain(built.stdout) or None, **_condition(phone)}


def phone_condition(serial: str) -> Facts:
    """Battery and thermal status; raise DeviceGoneError or PhoneError."""
    return _condition(Phone(serial))


def describe_here() -> Facts:
    """This host's processor and memory."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "machine": platform.machine(),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "system": plain(f"{platform.system()} {platform.release()}"),
    }


def _condition(phone: Phone) -> Facts:
    """Charge in percent, temperature in degrees Celsius, thermal status by number and name; None where unknown."""
    said = read_condition(phone)
    battery, thermal = said["battery"], said["thermal_status"]
    tenths = battery["temperature"]
    return {
        "battery": {
            "level": battery["level"],
            "celsius": None if tenths is None else tenths / 10,
            "status": _CHARGING.get(battery["status"]),
            "plugged": battery["plugged"],
        },
        "thermal": {
            "status": thermal,
            "name": _THERMAL[thermal] if thermal is not None and thermal < len(_THERMAL) else None,
        },
    }


def _joined(maker: str | None, model: str | None) -> str:
    if maker and model and model.lower().startswith(maker.lower()):
        return model
    return " ".join(word for word in (maker, model) if word)


def _cpu() -> str | None:
    try:
        text = Path("/proc/cpuinfo").read_text(errors="replace")
    except OSError:
        return None
    found = re.search(r"^model name\s*: *(.+)$", text, re.MULTILINE)
    return plain(found[1]) if found else None
