"""A study's progress in the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import fmean
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column

from server.live.time_left import JobTimes, seconds_left
from server.store.defaults import LLVMPIPE

if TYPE_CHECKING:
    from renderer.request import Request


def slices_bar(console: Console, *, hidden: bool = False) -> Progress:
    """A bar for slices; a task of it has a field `left`, the time left in words."""
    whole = Column(no_wrap=True)
    return Progress(
        BarColumn(bar_width=20),
        MofNCompleteColumn(table_column=whole),
        TextColumn("slices", table_column=whole),
        TimeElapsedColumn(table_column=whole),
        TextColumn("{task.fields[left]}", table_column=whole),
        TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)),
        console=console,
        disable=hidden,
        expand=True,
    )


@dataclass
class _Alike:
    """Requests that are alike, and how their slices went."""

    scene: str
    first_open: int = 0
    later_open: int = 0
    first_s: list[float] = field(default_factory=list)
    later_s: list[float] = field(default_factory=list)

    def times(self) -> JobTimes:
        first, later = (fmean(each) if each else None for each in (self.first_s, self.later_s))
        return JobTimes(LLVMPIPE, self.scene, first, later, self.first_open, self.later_open)


class Pace:
    """The times of the slices of requests that run here, one after the other."""

    def __init__(self, requests: Iterable[Request]) -> None:
        self._jobs: dict[Request, _Alike] = {}
        for request in requests:
            alike = self._jobs.setdefault(request, _Alike(request.scene))
            alike.first_open += 1
            alike.later_open += request.rounds - 1

    def ended(self, request: Request, round_index: int, seconds: float) -> None:
        """Count a slice that was measured."""
        alike = self._jobs[request]
        if round_index == 0:
            alike.first_open -= 1
            alike.first_s.append(seconds)
        else:
            alike.later_open -= 1
            alike.later_s.append(seconds)

    def failed(self, request: Request, round_index: int) -> int:
        """Count a slice that failed, and with it the later ones of its job, which will not run; how many these are."""
        alike, later = self._jobs[request], request.rounds - round_index
        if round_index == 0:
            alike.first_open, later = alike.first_open - 1, later - 1
        alike.later_open -= later
        return request.rounds - round_index

    def seconds_left(self) -> float | None:
        """The seconds until all have ended; None before it can be known."""
        return seconds_left((alike.times() for alike in self._jobs.values()), {})
