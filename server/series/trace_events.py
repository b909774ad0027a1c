"""Chrome's trace event format, as Perfetto's interface reads it: spans, instants, counters and tracks' names.

Times go in as nanoseconds from the trace's origin, whole, so that a span ends where the next one begins; the format
has microseconds. Spans of a track must nest (https://perfetto.dev/docs/faq), so `lanes` spreads those that do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

Json = dict[str, Any]


@dataclass
class Trace:
    """A trace that is being written; `origin` is the time of its zero, ISO 8601."""

    origin: str
    _names: list[Json] = field(default_factory=list)
    _events: list[Json] = field(default_factory=list)

    def name_process(self, pid: int, name: str) -> None:
        """Name a process; processes are shown in the order of their ids."""
        self._name("process", pid, 0, name)

    def name_track(self, pid: int, tid: int, name: str) -> None:
        """Name a track of a process; tracks are shown in the order of their ids."""
        self._name("thread", pid, tid, name)

    def add_span(self, pid: int, tid: int, name: str, start: int, end: int, **args: Any) -> None:
        """Something with a beginning and an end."""
        self._add("X", pid, tid, name, start, dur=(end - start) / 1000, args=args)

    def add_instant(self, pid: int, tid: int, name: str, at: int, **args: Any) -> None:
        """Something that happened at a time."""
        self._add("i", pid, tid, name, at, s="t", args=args)

    def add_counter(self, pid: int, name: str, at: int, value: float) -> None:
        """A figure from a time on."""
        self._add("C", pid, 0, name, at, args={"value": value})

    def document(self, **about: Any) -> Json:
        """The whole trace, its events in the order of time, a span before those within it."""
        events = sorted(self._events, key=lambda event: (event["ts"], -event.get("dur", 0)))
        other = {"origin": self.origin, **about}
        return {"traceEvents": [*self._names, *events], "displayTimeUnit": "ms", "otherData": other}

    def _name(self, what: str, pid: int, tid: int, name: str) -> None:
        for kind, args in ((f"{what}_name", {"name": name}), (f"{what}_sort_index", {"sort_index": tid or pid})):
            self._names.append({"name": kind, "ph": "M", "ts": 0, "pid": pid, "tid": tid, "args": args})

    def _add(self, phase: str, pid: int, tid: int, name: str, at: int, **fields: Any) -> None:
        self._events.append({"name": name, "ph": phase, "ts": at / 1000, "pid": pid, "tid": tid, **fields})


def lanes(spans: Sequence[tuple[int, int]]) -> list[int]:
    """A lane for each span (start, end), so that those of one lane do not overlap; the first lane that is free."""
    free: list[int] = []
    chosen = [0] * len(spans)
    for i in sorted(range(len(spans)), key=lambda i: spans[i]):
        start, end = spans[i]
        lane = next((lane for lane, until in enumerate(free) if until <= start), len(free))
        free[lane : lane + 1] = [end]
        chosen[i] = lane
    return chosen
