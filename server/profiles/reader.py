"""A profiler's file read in blocks: every series' figures, in memory that does not grow with the file."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pandas as pd

from server.profiles.blocks import read_blocks, read_first_line
from server.profiles.errors import ProfileError
from server.profiles.formats import AUTO, Layout, read_layout
from server.profiles.summary import Summaries, Summary

LARGEST = 1e100
"""Beyond it a sum of values would leave the doubles."""


@dataclass(frozen=True)
class Imported:
    """What a file held: its format, the number of its rows, and a summary of every series in the order they came."""

    format: str
    rows: int
    summaries: list[Summary]


def read_profile(path: Path, name: str = AUTO, column_map: Mapping[str, str] | None = None) -> Imported:
    """Read a file; raise ProfileError with one sentence when any of it is not understood.

    Its values are spooled to a temporary file beside it, a sixth of its size for the long formats.
    """
    with path.open("rb") as file, tempfile.TemporaryFile(dir=path.parent) as spool:
        layout = read_layout(read_first_line(file), name, column_map)
        summaries, rows = Summaries(spool), 0
        for table in _tables(file, layout):
            _add(table, layout, summaries, rows)
            rows += len(table)
        found = summaries.finish()
        if not found:
            raise ProfileError("The file holds no value below its first line: export the profile again.")
        return Imported(layout.format, rows, found)


def _tables(file: BinaryIO, layout: Layout) -> Iterator[pd.DataFrame]:
    for block in read_blocks(file):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                # One column more than there are shows rows that are too long, and takes a delimiter at each row's end.
                yield pd.read_csv(
                    StringIO(block),
                    sep=layout.delimiter,
                    header=None,
                    names=range(layout.width + 1),
                    index_col=False,
                    dtype=str,
                    keep_default_na=False,
                    na_values=[""],
                    skipinitialspace=True,
                )
        except pd.errors.EmptyDataError:
            continue
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            raise ProfileError("The file is no CSV: some rows have more fields than the first line.") from error


def _add(table: pd.DataFrame, layout: Layout, summaries: Summaries, rows: int) -> None:
    longer = table[layout.width].notna().to_numpy()
    if longer.any():
        row = rows + 1 + int(longer.argmax())
        raise ProfileError(f"The file is no whole CSV: row {row} has more fields than the first line.")
    if layout.metric is None:
        _add_wide(table, layout, summaries, rows)
    else:
        _add_long(table, layout, summaries, rows)


def _add_long(table: pd.DataFrame, layout: Layout, summaries: Summaries, rows: int) -> None:
    assert layout.metric is not None
    assert layout.value is not None
    for place, what in ((layout.metric, "metric"), (layout.value, "value")):
        absent = table[place].isna().to_numpy()
        if absent.any():
            raise ProfileError(f"Row {rows + 1 + int(absent.argmax())} has no {what}: the file is broken or was cut.")
    keys = pd.DataFrame(
        {
            what: "" if place is None else table[place].fillna("")
            for what, place in (("metric", layout.metric), ("source", layout.source), ("unit", layout.unit))
        },
        index=table.index,
    )
    groups = keys.groupby(["metric", "source", "unit"], sort=False)
    written = keys.drop_duplicates().itertuples(index=False, name=None)
    numbers = np.array([summaries.number(*key) for key in written], np.int32)
    summaries.add(numbers[groups.ngroup().to_numpy()], _values(table[layout.value], rows), _times(table, layout))


def _add_wide(table: pd.DataFrame, layout: Layout, summaries: Summaries, rows: int) -> None:
    for place, metric in layout.wide.items():
        there = table[table[place].notna()]
        if len(there):
            number = np.full(len(there), summaries.number(metric), np.int32)
            summaries.add(number, _values(there[place], rows), _times(there, layout))


def _values(texts: pd.Series[str], rows: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    values = pd.to_numeric(texts, errors="coerce").to_numpy(np.float64)
    wrong = ~(np.abs(values) <= LARGEST)
    if wrong.any():
        at = int(wrong.argmax())
        row = rows + 1 + int(texts.index[at])
        raise ProfileError(f"Row {row} has the value {texts.iloc[at][:40]!r}, which is no number: correct the file.")
    return values


def _times(table: pd.DataFrame, layout: Layout) -> pd.Series[str] | None:
    return None if layout.time is None else table[layout.time]
