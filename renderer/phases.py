"""Where a slice's time goes: wall milliseconds of each phase, from the start of its process."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

WORK = ("compiling", "measuring", "collecting", "judging")
"""What is done for the figures themselves: compilation with upload and warm-up, frames, the instrumented run, judging.
All else is the harness: `starting` the process, `preparing` (scene, tree, buffers, plans), `pictures`, `other`."""
HARNESS = ("starting", "preparing", "pictures", "other")


class Phases:
    """Adds up phases; waiting for a lock is in none of them."""

    def __init__(self) -> None:
        """The clock starts now."""
        self.ms: dict[str, float] = {}
        self._begun = time.perf_counter()
        self._waited = 0.0

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Count the block as a phase."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.add(name, time.perf_counter() - begun)

    def add(self, name: str, seconds: float) -> None:
        """Count seconds as a phase."""
        self.ms[name] = self.ms.get(name, 0.0) + seconds * 1e3

    def wait(self, seconds: float) -> None:
        """Leave seconds out."""
        self._waited += seconds

    def total(self, starting_s: float | None = None) -> dict[str, float]:
        """Every phase, and what of the time until now is in none of them as `other`."""
        passed = (time.perf_counter() - self._begun - self._waited) * 1e3
        known = self.ms | {"other": max(0.0, passed - sum(self.ms.values()))}
        return known if starting_s is None else {"starting": starting_s * 1e3} | known


def process_age_s() -> float | None:
    """The seconds since this process was started; None where the kernel does not tell (proc(5), starttime)."""
    try:
        after_name = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
        started = int(after_name[19]) / os.sysconf("SC_CLK_TCK")
        return max(0.0, time.clock_gettime(time.CLOCK_BOOTTIME) - started)
    except (OSError, ValueError, IndexError, AttributeError):
        return None
