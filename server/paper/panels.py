"""What a chart shows: panels of bars in groups."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from renderer.times.interval import median, median_interval
from server.paper.data import Cell, Section
from server.paper.measures import Measure, error_of
from server.paper.series import rounds_of
from server.paper.words import figure_text, fraction_text

COLOURS = 6
"""A chart has at most so many series."""


@dataclass(frozen=True)
class Bar:
    """One figure of one series; `note` stands beside it."""

    series: str
    value: float | None
    low: float | None = None
    high: float | None = None
    note: str = ""

    @property
    def text(self) -> str:
        """The figure with its note."""
        return figure_text(self.value) + (f", {self.note}" if self.note and self.value is not None else "")


@dataclass(frozen=True)
class Panel:
    """One chart: bars by groups, all in one unit."""

    title: str
    unit: str
    groups: tuple[tuple[str, tuple[Bar, ...]], ...]

    @property
    def empty(self) -> bool:
        """Whether nothing in it was measured."""
        return all(bar.value is None for _, bars in self.groups for bar in bars)

    @property
    def series(self) -> list[str]:
        """The names of its series in their order."""
        return list(dict.fromkeys(bar.series for _, bars in self.groups for bar in bars))


MakeBar = Callable[[str, Cell], Bar]


def panel(title: str, unit: str, groups: Mapping[str, Mapping[str, Cell]], make: MakeBar) -> Panel:
    """A panel whose groups name each series' cell."""
    made = ((name, tuple(make(series, cell) for series, cell in cells.items())) for name, cells in groups.items())
    return Panel(title, unit, tuple(made))


def speed_unit(section: Section) -> str:
    """What a speed is counted in."""
    return "frames per CPU-second" if section.clock == "cpu" else "frames a second"


def speed_bars(section: Section) -> MakeBar:
    """Speeds: one by the median of all frames, with that median's 95 % interval and the error beside it."""

    def make(series: str, cell: Cell) -> Bar:
        document = section.documents.get(cell)
        times = [time for frames in rounds_of(document, section.clock) for time in frames]
        if document is None or not times:
            return Bar(series, None)
        interval = median_interval(times)
        low, high = (1000 / interval[1], 1000 / interval[0]) if interval else (None, None)
        error = error_of(document)
        return Bar(series, 1000 / median(times), low, high, "" if error is None else f"error {fraction_text(error)}")

    return make


def measure_bars(section: Section, measure: Measure) -> MakeBar:
    """Figures of a measure, which have no interval."""

    def make(series: str, cell: Cell) -> Bar:
        document = section.documents.get(cell)
        return Bar(series, None if document is None else measure.read(document))

    return make


def cells_of(panels: Iterable[Mapping[str, Mapping[str, Cell]]]) -> Sequence[Cell]:
    """All cells of panels' groups."""
    return [cell for groups in panels for cells in groups.values() for cell in cells.values()]
