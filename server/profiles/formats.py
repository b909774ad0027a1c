"""The profilers' formats: which columns a file has, and what each is. One table; a new format is a new entry.

Sources: Snapdragon Profiler's realtime form after a third party's parser, its per-draw form and AGI's after their
documentation, Perfetto's after its own tests. No column's unit of time is verified: times are kept as texts.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from server.profiles.errors import ProfileError

DELIMITERS = (",", ";", "\t")
MAPPED = "mapped"
AUTO = "auto"


@dataclass(frozen=True)
class Format:
    """What a file's columns are, by their names.

    Long files have a row per value (`metric` and `value`, perhaps `unit`); wide ones a column per metric, `wide` giving
    each its name. `source` tells series of one name apart, `time` orders their values.
    """

    label: str
    time: str = ""
    metric: str = ""
    value: str = ""
    unit: str = ""
    source: str = ""
    others: tuple[str, ...] = ()
    wide: Mapping[str, str] = field(default_factory=dict)

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns that a file of this format has."""
        single = (self.time, self.metric, self.value, self.unit, self.source)
        return tuple(name for name in (*single, *self.others, *self.wide) if name)


FORMATS: dict[str, Format] = {
    "snapdragon-realtime": Format(
        "Snapdragon Profiler, realtime",
        time="Timestamp",
        metric="Metric",
        value="Value",
        source="Process",
        others=("Category", "TimestampRaw"),
    ),
    "snapdragon-draws": Format(
        "Snapdragon Profiler, per draw", time="DrawID", metric="MetricName", value="Value", source="CaptureID"
    ),
    "perfetto": Format(
        "Perfetto GPU counters",
        time="ts",
        metric="name",
        value="value",
        unit="unit",
        source="gpu_id",
        others=("description",),
    ),
    "agi-gapit": Format("AGI gapit", time="BeginCmd", others=("EndCmd",), wide={"Time(ns)": "Time(ns)"}),
}
ROLES = {"@time": "time", "@metric": "metric", "@value": "value", "@unit": "unit"}


@dataclass(frozen=True)
class Layout:
    """Where a file's columns are, counted from 0; `width` is their number. A column is None where there is none."""

    format: str
    delimiter: str
    width: int
    time: int | None
    metric: int | None
    value: int | None
    unit: int | None
    source: int | None
    wide: Mapping[int, str]


def read_layout(line: str, name: str = AUTO, column_map: Mapping[str, str] | None = None) -> Layout:
    """Find out what a file is by its first line; raise ProfileError when it is none of FORMATS and not mapped."""
    header, delimiter = _read_header(line)
    if column_map:
        if name not in (AUTO, MAPPED):
            raise ProfileError(f"The format {name} needs no column map: leave one of the two out.")
        return _place(MAPPED, _mapped(column_map), header, delimiter)
    known = {**FORMATS}
    if name != AUTO:
        if name not in FORMATS:
            given = "It needs" if name == MAPPED else f"Unknown format {name[:80]!r}: choose from {_names()}, or give"
            raise ProfileError(f"{given} a column map, METRIC=COLUMN.")
        known = {name: FORMATS[name]}
    for key, form in known.items():
        if set(form.columns) <= set(header):
            return _place(key, form, header, delimiter)
    if name != AUTO:
        raise ProfileError(f"This is no {FORMATS[name].label} file: {_missing(FORMATS[name], header)}.")
    raise ProfileError(
        f"No known format begins with {line.strip()[:80]!r}: export the profile as CSV, or say which columns hold what "
        "with a column map (METRIC=COLUMN)."
    )


def read_map(words: Sequence[str]) -> dict[str, str]:
    """Read METRIC=COLUMN and the roles @time, @metric, @value, @unit; raise ProfileError when one is neither."""
    pairs: dict[str, str] = {}
    for word in words:
        metric, equals, column = (part.strip() for part in word.partition("="))
        if not (metric and equals and column):
            raise ProfileError(f"The map {word[:80]!r} is not understood: write METRIC=COLUMN, or @time=COLUMN.")
        if metric.startswith("@") and metric not in ROLES:
            raise ProfileError(f"Unknown role {metric[:80]!r}: choose one of {', '.join(ROLES)}.")
        if metric in pairs:
            raise ProfileError(f"{metric[:80]!r} is mapped twice: leave one out.")
        pairs[metric] = column
    return pairs


def _mapped(column_map: Mapping[str, str]) -> Format:
    roles = {ROLES[key]: column for key, column in column_map.items() if key in ROLES}
    wide = {column: metric for metric, column in column_map.items() if metric not in ROLES}
    if len(wide) < sum(metric not in ROLES for metric in column_map):
        raise ProfileError("Two metrics are mapped to one column: leave one out.")
    long = "metric" in roles and "value" in roles
    if bool(wide) == long or (not long and roles.keys() - {"time"}):
        raise ProfileError("Map either metrics to their columns (METRIC=COLUMN), or both @metric and @value.")
    at = roles.get
    return Format(MAPPED, at("time", ""), at("metric", ""), at("value", ""), at("unit", ""), wide=wide)


def _place(name: str, form: Format, header: list[str], delimiter: str) -> Layout:
    if not set(form.columns) <= set(header):
        raise ProfileError(f"The column map does not fit: {_missing(form, header)}.")

    def at(column: str) -> int | None:
        if not column:
            return None
        if header.count(column) > 1:
            raise ProfileError(f"The column {column!r} appears twice: leave one out.")
        return header.index(column)

    wide = {place: metric for column, metric in form.wide.items() if (place := at(column)) is not None}
    long = (at(form.metric), at(form.value), at(form.unit), at(form.source))
    return Layout(name, delimiter, len(header), at(form.time), *long, wide)


def _read_header(line: str) -> tuple[list[str], str]:
    delimiter = max(DELIMITERS, key=line.count)
    try:
        header = next(csv.reader([line.strip("\r\n")], delimiter=delimiter, skipinitialspace=True, strict=True), [])
    except csv.Error:
        header = []
    return [name.strip() for name in header], delimiter


def _missing(form: Format, header: Sequence[str]) -> str:
    missing = next(column for column in form.columns if column not in header)
    there = ", ".join(repr(name[:40]) for name in header[:20])
    return f"there is no column {missing!r} among {there}"


def _names() -> str:
    return ", ".join((AUTO, *FORMATS))
