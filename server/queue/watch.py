"""How long workers have given no sign of life, by a clock that does not jump.

A sign of life is a change of the worker's row, whatever time is written there: hosts may differ in their clocks, and a
clock may be set. Each watcher times the silence between changes by its own monotonic clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime


@dataclass
class Watch:
    """One process's view of who is silent; `lease_s` of silence, in seconds, is death.

    Of the time since the last look at most a quarter of the lease counts: while a watcher is stopped, or the database
    does not answer, nobody could be seen to live.
    """

    lease_s: float
    clock: Callable[[], float] = time.monotonic
    _looked_at: float | None = None
    _seen: dict[str, datetime] = field(default_factory=dict)
    _silent_s: dict[str, float] = field(default_factory=dict)

    def silent(self, beats: Sequence[tuple[str, datetime]]) -> list[str]:
        """Of the workers (id, last sign of life) those that have been silent for the lease."""
        time_s = self.clock()
        passed_s = 0.0 if self._looked_at is None else min(time_s - self._looked_at, self.lease_s / 4)
        self._looked_at = time_s
        self._silent_s = {
            worker: self._silent_s[worker] + passed_s if self._seen.get(worker) == beat_at else 0.0
            for worker, beat_at in beats
        }
        self._seen = dict(beats)
        return [worker for worker, silent_s in self._silent_s.items() if silent_s >= self.lease_s]

    def forget(self) -> None:
        """Count all silence anew: after a write that failed, since a worker's sign of life may have failed alike."""
        self._seen.clear()
