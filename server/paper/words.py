"""Figures and lists written for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

from server.comparison.figures import write_value
from server.comparison.metrics import Metric

_PLAIN = Metric("plain", "", "", "lower")
_FRACTION = Metric("fraction", "", "", "lower", "fraction")


def figure_text(value: float | None) -> str:
    """A figure with three significant digits."""
    return "not measured" if value is None else write_value(_PLAIN, value)


def fraction_text(value: float | None) -> str:
    """A fraction of rays, such as an error."""
    return "not measured" if value is None else write_value(_FRACTION, value)


def ratio_text(value: float) -> str:
    """A ratio with three digits after the point where it is near 1, else with three significant ones."""
    return f"{value:.3f}" if 0.1 <= value < 9.995 and math.isfinite(value) else figure_text(value)


def interval_text(value: float, low: float | None, high: float | None) -> str:
    """A ratio with its interval."""
    return ratio_text(value) if low is None or high is None else f"{ratio_text(value)} ({range_text(low, high)})"


def range_text(low: float, high: float) -> str:
    """Two ends of a range of ratios."""
    return f"{ratio_text(low)} to {ratio_text(high)}"


def joined(names: Sequence[str], last: str = "and") -> str:
    """Names as `a, b and c`."""
    return f" {last} ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def counted(number: int, thing: str) -> str:
    """A number of things."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def lower_first(text: str) -> str:
    """A name within a sentence; one that begins with an abbreviation stays as it is."""
    return text if text[1:2].isupper() else text[:1].lower() + text[1:]


def upper_first(text: str) -> str:
    """A name that begins a sentence."""
    return text[:1].upper() + text[1:]
