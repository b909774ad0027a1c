"""The rules of Chrome's trace event format that Perfetto's reader holds a trace to."""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any

Json = dict[str, Any]
FIELDS = {
    "X": {"name", "ph", "ts", "dur", "pid", "tid", "args"},
    "i": {"name", "ph", "ts", "s", "pid", "tid", "args"},
    "C": {"name", "ph", "ts", "pid", "tid", "args"},
    "M": {"name", "ph", "ts", "pid", "tid", "args"},
}
METADATA = {"process_name", "process_sort_index", "thread_name", "thread_sort_index"}


def assert_rules(trace: Json) -> None:
    """Fail where a trace breaks a rule: fields and their kinds, order, nesting, names of all tracks."""
    assert isinstance(trace["traceEvents"], list)
    tracks: dict[tuple[int, int], list[Json]] = defaultdict(list)
    named = set()
    for event in trace["traceEvents"]:
        assert set(event) == FIELDS[event["ph"]]
        assert isinstance(event["name"], str)
        assert event["name"]
        assert type(event["pid"]) is type(event["tid"]) is int
        assert _is_time(event["ts"])
        if event["ph"] == "M":
            assert event["name"] in METADATA
            named.add((event["name"], event["pid"], event["tid"]))
        elif event["ph"] == "C":
            assert event["args"]
            assert all(_is_number(value) for value in event["args"].values())
        else:
            tracks[event["pid"], event["tid"]].append(event)
    for (pid, tid), events in tracks.items():
        assert ("thread_name", pid, tid) in named
        assert ("process_name", pid, 0) in named
        assert [event["ts"] for event in events] == sorted(event["ts"] for event in events)
        _assert_nested([event for event in events if event["ph"] == "X"])


def spans(trace: Json, track: str) -> list[Json]:
    """The spans of the tracks whose names begin so, in order."""
    ids = {
        (event["pid"], event["tid"])
        for event in trace["traceEvents"]
        if event["name"] == "thread_name" and event["args"]["name"].startswith(track)
    }
    return [event for event in trace["traceEvents"] if event["ph"] == "X" and (event["pid"], event["tid"]) in ids]


def counters(trace: Json, name: str) -> list[float]:
    """The values of the counters whose names begin so, in order."""
    found = (event for event in trace["traceEvents"] if event["ph"] == "C" and event["name"].startswith(name))
    return [event["args"]["value"] for event in found]


def _assert_nested(found: list[Json]) -> None:
    """Spans of a track lie one in the other or apart; a nanosecond is the reader's resolution."""
    open_until: list[int] = []
    for event in found:
        assert _is_time(event["dur"])
        start, end = round(event["ts"] * 1000), round(event["ts"] * 1000) + round(event["dur"] * 1000)
        while open_until and open_until[-1] <= start:
            open_until.pop()
        assert not open_until or end <= open_until[-1]
        open_until.append(end)


def _is_time(value: Any) -> bool:
    return _is_number(value) and value >= 0


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value)
