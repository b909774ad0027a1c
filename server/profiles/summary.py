"""Every series' count, mean, median, range, and first and last time, gathered block by block."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from server.profiles.errors import ProfileError
from server.profiles.names import Series, read_series
from server.profiles.spool import Spool, Values

if TYPE_CHECKING:
    import pandas as pd

MAX_SERIES = 10_000
MAX_TIME = 100


@dataclass(frozen=True)
class Summary:
    """A series' figures in its unit; times are the first and last row's texts, their own unit unverified."""

    series: Series
    count: int
    mean: float
    median: float
    min: float
    max: float
    first_time: str | None
    last_time: str | None


@dataclass
class _Running:
    """A series' figures so far."""

    series: Series
    count: int = 0
    total: float = 0.0
    min: float = np.inf
    max: float = -np.inf
    first_time: str | None = None
    last_time: str | None = None


@dataclass
class Summaries:
    """The summaries of a file that is being read; its values go to the file `spool`."""

    spool: BinaryIO
    _numbers: dict[tuple[str, str, str], int] = field(default_factory=dict)
    _by_series: dict[tuple[str, str | None, str | None], int] = field(default_factory=dict)
    _units: dict[str, str | None] = field(default_factory=dict)
    _running: list[_Running] = field(default_factory=list)

    def number(self, metric: str, source: str = "", unit: str = "") -> int:
        """The number of the series of a metric as written; raise ProfileError for a second unit of one metric."""
        key = (metric, source, unit)
        if key not in self._numbers:
            self._numbers[key] = self._place(read_series(*key))
        return self._numbers[key]

    def add(self, numbers: NDArray[np.int32], values: Values, times: pd.Series[str] | None) -> None:
        """Add values, each of the series of its number; times as texts, where the file has them."""
        order = np.argsort(numbers, kind="stable")
        starts = np.flatnonzero(np.diff(numbers[order], prepend=-1))
        for at in np.split(order, starts[1:]):
            self._add_to(self._running[int(numbers[at[0]])], values[at])
            if times is not None:
                _add_times(self._running[int(numbers[at[0]])], times.iloc[at[0]], times.iloc[at[-1]])
        Spool(self.spool).add(numbers, values)

    def finish(self) -> list[Summary]:
        """All summaries, in the order in which the series came."""
        medians = Spool(self.spool).medians(np.array([one.count for one in self._running], np.int64))
        return [
            Summary(one.series, one.count, _mean(one), float(median), one.min, one.max, one.first_time, one.last_time)
            for one, median in zip(self._running, medians, strict=True)
        ]

    def _place(self, series: Series) -> int:
        unit = self._units.setdefault(series.name, series.unit)
        if unit != series.unit:
            mixed = f"{unit or 'no unit'} and {series.unit or 'no unit'}"
            raise ProfileError(f"The metric {series.name!r} has values in {mixed}: import a file for each.")
        place = self._by_series.setdefault((series.name, series.instance, series.source), len(self._running))
        if place == len(self._running):
            if place >= MAX_SERIES:
                raise ProfileError(f"The file has more than {MAX_SERIES} metrics: the wrong column may be mapped.")
            self._running.append(_Running(series))
        return place

    @staticmethod
    def _add_to(one: _Running, values: Values) -> None:
        one.count += len(values)
        one.total += float(values.sum())
        one.min, one.max = min(one.min, float(values.min())), max(one.max, float(values.max()))


def _add_times(one: _Running, first: object, last: object) -> None:
    if one.first_time is None and isinstance(first, str):
        one.first_time = first[:MAX_TIME]
    if isinstance(last, str):
        one.last_time = last[:MAX_TIME]


def _mean(one: _Running) -> float:
    # Rounding must not carry the mean out of the range.
    return min(max(one.total / one.count, one.min), one.max)
