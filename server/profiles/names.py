"""What a metric is called, apart from its instance and its unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

from server.profiles.errors import ProfileError
from server.profiles.units import read_unit, split_unit

MAX_NAME, MAX_SOURCE, MAX_UNIT = 300, 300, 100
_INSTANCE = re.compile(r"\s*\[([^\[\]]{1,100})\]$")


@dataclass(frozen=True)
class Series:
    """What a file's values belong to: a metric's name, its instance (`FPS[1]`), what else tells it apart, its unit."""

    name: str
    instance: str | None
    source: str | None
    unit: str | None


def read_series(written: str, source: str = "", unit: str = "") -> Series:
    """The series of a metric as a file writes it; a unit of its own column goes before the one in the name."""
    whole, instance = _split_instance(written.strip())
    name, named_unit = split_unit(whole)
    if instance is None:
        name, instance = _split_instance(name)
    found = read_unit(unit) or named_unit
    limits = (("name", whole, MAX_NAME), ("source", source, MAX_SOURCE), ("unit", found or "", MAX_UNIT))
    for what, text, most in limits:
        if len(text) > most:
            raise ProfileError(f"The metric {written[:40]!r} has a {what} of more than {most} characters: shorten it.")
    return Series(name or whole, instance, source.strip() or None, found)


def _split_instance(text: str) -> tuple[str, str | None]:
    ending = _INSTANCE.search(text)
    return (text[: ending.start()], ending[1].strip()) if ending and ending.start() else (text, None)
