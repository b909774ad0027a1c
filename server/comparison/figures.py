"""Figures written for people, on pages and in the terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from server.comparison.metrics import Figure, Metric

if TYPE_CHECKING:
    from server.comparison.ratios import Ratio

NOT_MEASURED = "not measured"
UNITS = ("B", "KB", "MB", "GB", "TB")
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def write_value(metric: Metric, value: float | None) -> str:
    """A value with three significant digits, without its unit (bytes carry theirs)."""
    if value is None:
        return NOT_MEASURED
    if metric.kind == "bytes":
        return _bytes(value)
    return _fraction(value) if metric.kind == "fraction" else _number(value)


def write_figure(metric: Metric, figure: Figure) -> str:
    """A value with its unit."""
    text = write_value(metric, figure.value)
    return text if figure.value is None or not metric.unit else f"{text} {metric.unit}".replace(" /", "/")


def write_interval(metric: Metric, figure: Figure) -> str:
    """The 95 % interval as `low–high`, or nothing."""
    if figure.low is None or figure.high is None:
        return ""
    return f"{write_value(metric, figure.low)}–{write_value(metric, figure.high)}"


def write_ratio(ratio: Ratio) -> str:
    """A ratio to a baseline with its interval and verdict, or why there is none."""
    if ratio.value is None:
        return ratio.note
    return ", ".join(text for text in (f"{write_times(ratio.value)}{_ends(ratio)}", ratio.verdict, ratio.note) if text)


def write_times(value: float) -> str:
    """A ratio with three significant digits."""
    return f"{_number(value)}×"


def _ends(ratio: Ratio) -> str:
    return "" if ratio.low is None or ratio.high is None else f" ({_number(ratio.low)}–{_number(ratio.high)})"


def write_percent(fraction: float) -> str:
    """A fraction as a percentage, below 10 % with one digit after the point."""
    return f"{fraction * 100:.{1 if abs(fraction) < 0.0995 else 0}f} %"


def _number(value: float) -> str:
    if value == 0:
        return "0"
    if abs(value) >= 1e6 or abs(value) < 1e-3:
        return _powers(value)
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{digits}f}"


def _fraction(value: float) -> str:
    return _number(value) if value == 0 or value >= 0.01 else _powers(value)


def _powers(value: float) -> str:
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}×10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def _bytes(value: float) -> str:
    for unit in UNITS:
        if value < 1000 or unit == UNITS[-1]:
            return f"{value:.0f} {unit}" if unit == "B" and value == int(value) else f"{_number(value)} {unit}"
        value /= 1000
    raise AssertionError("unreachable: the last unit takes every value")
