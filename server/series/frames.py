"""The raw frames of a result in their order, with the rounds that they come from and what was read beside them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from renderer.times.interval import median
from server.series.readings import Reading, read_readings

Json = dict[str, Any]


@dataclass(frozen=True)
class Frame:
    """One timed frame; `round` and `index` within it count from 1. A time that the device does not tell is None."""

    round: int
    index: int
    wall_ms: float | None
    cpu_ms: float | None
    gpu_ms: float | None


@dataclass(frozen=True)
class Round:
    """One round: its first frame's place in the series, counted from 0, and its frames' number.

    `throttled` is None where the device does not tell; the thermal status is Android's, before and after the frames.
    """

    number: int
    first: int
    frames: int
    started_at: str | None
    median_ms: float | None
    throttled: bool | None
    thermal_before: int | None
    thermal_after: int | None


@dataclass(frozen=True)
class Series:
    """A job's frames; `unavailable` names the counters that could not be read, with the reason."""

    frames: list[Frame]
    rounds: list[Round]
    readings: list[Reading]
    unavailable: dict[str, str]


def read_series(document: Json) -> Series:
    """The series of a result's document; empty where that kept no frames."""
    wall = document.get("frames_ms") or []
    counts = _counts(document.get("frames_by_round"), len(wall))
    cpu, gpu = (_aligned(document.get(f"frames_{clock}_ms"), len(wall)) for clock in ("cpu", "gpu"))
    samples = document.get("samples") or []
    # A result keeps the samples of rounds that have any: with fewer of them than rounds nobody knows whose they are.
    placed = samples if len(samples) == len(counts) else []
    frames: list[Frame] = []
    rounds = []
    for number, count in enumerate(counts):
        first = len(frames)
        frames += [Frame(number + 1, i + 1, *(clock[first + i] for clock in (wall, cpu, gpu))) for i in range(count)]
        started = (document.get("rounds_started_at") or [])[number : number + 1]
        sample = placed[number] if placed else {}
        rounds.append(_round(number, first, frames[first:], started, sample))
    unavailable = {name: str(reason) for sample in placed for name, reason in (sample.get("unavailable") or {}).items()}
    return Series(frames, rounds, read_readings(placed, counts) if placed else [], unavailable)


def series_view(series: Series) -> Json:
    """A series as the API shows it."""
    return {
        "frames": [asdict(frame) for frame in series.frames],
        "rounds": [asdict(one) for one in series.rounds],
        "readings": [
            {
                "name": reading.name,
                "label": reading.kind.label,
                "unit": reading.kind.unit,
                "files": list(reading.files),
                "values": list(reading.values),
            }
            for reading in series.readings
        ],
        "unavailable": series.unavailable,
    }


def frame_rows(series: Series) -> tuple[list[str], list[list[Any]]]:
    """The series as a table, a row a frame: the columns' names, and the rows."""
    names = ["round", "index", "wall_ms", "cpu_ms", "gpu_ms", *(reading.column for reading in series.readings)]
    rows = [
        [*asdict(frame).values(), *(reading.values[i] for reading in series.readings)]
        for i, frame in enumerate(series.frames)
    ]
    return names, rows


def series_csv(series: Series) -> str:
    """The table as CSV, what was not measured empty."""
    names, rows = frame_rows(series)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(rows)
    return text.getvalue()


def _round(number: int, first: int, frames: Sequence[Frame], started: Sequence[Any], sample: Json) -> Round:
    wall = [frame.wall_ms for frame in frames if frame.wall_ms is not None]
    before, after = ((sample.get(when) or {}).get("thermal_status") for when in ("before", "after"))
    return Round(
        number + 1,
        first,
        len(frames),
        started[0] if started else None,
        median(wall) if wall else None,
        sample.get("throttled"),
        before,
        after,
    )


def _counts(by_round: Any, frames: int) -> list[int]:
    """Frames a round; one round of all where a document does not tell."""
    told = [int(count) for count in by_round or []]
    return told if sum(told) == frames and all(count > 0 for count in told) else [frames] * (frames > 0)


def _aligned(times: Any, frames: int) -> list[float | None]:
    """A clock's times frame by frame: all None where it told some only, since nobody knows which."""
    return list(times) if times and len(times) == frames else [None] * frames
