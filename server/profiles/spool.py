"""The values of many series on disk, so that exact medians need little memory."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

ENTRY = np.dtype([("series", "<i4"), ("value", "<f8")])
BATCH = 1 << 20
"""How many values are held at once (8 MiB of them)."""
DIGIT, DIGITS = 16, 4
"""A double's order-preserving pattern is refined 16 bits at a time."""

Values = NDArray[np.float64]


class Spool:
    """Values with the number of their series, in a file that is open for writing and reading."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def add(self, series: NDArray[np.int32], values: Values) -> None:
        """Add values."""
        entries = np.empty(len(values), ENTRY)
        entries["series"], entries["value"] = series, values
        self._file.write(entries.tobytes())

    def medians(self, counts: NDArray[np.int64]) -> Values:
        """Every series' median; `counts` are the numbers of their values, none of them 0."""
        medians = np.empty(len(counts))
        for batch in _batches(counts):
            if len(batch) == 1 and counts[batch[0]] > BATCH:
                medians[batch[0]] = self._median_of_many(batch[0], int(counts[batch[0]]))
            else:
                medians[batch] = self._medians_of_few(batch)
        return medians

    def _medians_of_few(self, batch: range) -> list[float]:
        found = [entries[_within(entries, batch)] for entries in self._entries()]
        together = np.concatenate(found)
        ordered = together[np.argsort(together["series"], kind="stable")]
        ends = np.searchsorted(ordered["series"], [*batch, batch.stop])
        return [float(np.median(ordered["value"][a:b])) for a, b in pairwise(ends)]

    def _median_of_many(self, series: int, count: int) -> float:
        low, high = self._select(series, (count - 1) // 2), self._select(series, count // 2)
        return low / 2 + high / 2

    def _select(self, series: int, rank: int) -> float:
        """The value of a rank: digit by digit, counting those that share the digits found so far."""
        prefix = 0
        for place in reversed(range(DIGITS)):
            counts = np.zeros(1 << DIGIT, np.int64)
            for entries in self._entries():
                keys = _keys(entries["value"][entries["series"] == series])
                same = keys if place == DIGITS - 1 else keys[keys >> np.uint64(DIGIT * (place + 1)) == prefix]
                digits = (same >> np.uint64(DIGIT * place)) & np.uint64((1 << DIGIT) - 1)
                counts += np.bincount(digits.astype(np.int64), minlength=1 << DIGIT)
            upto = np.cumsum(counts)
            digit = int(np.searchsorted(upto, rank, side="right"))
            rank -= int(upto[digit - 1]) if digit else 0
            prefix = prefix << DIGIT | digit
        return _value(prefix)

    def _entries(self) -> Iterator[np.ndarray[tuple[int], np.dtype[np.void]]]:
        self._file.seek(0)
        while data := self._file.read(BATCH // 4 * ENTRY.itemsize):
            yield np.frombuffer(data, ENTRY)


def _batches(counts: NDArray[np.int64]) -> Iterator[range]:
    """Series in turn, as many at once as have at most BATCH values together, at least one."""
    start, held = 0, 0
    for number, count in enumerate(counts):
        if number > start and held + count > BATCH:
            yield range(start, number)
            start, held = number, 0
        held += int(count)
    if len(counts):
        yield range(start, len(counts))


def _within(entries: np.ndarray[tuple[int], np.dtype[np.void]], batch: range) -> NDArray[np.bool_]:
    return np.asarray((entries["series"] >= batch.start) & (entries["series"] < batch.stop))


def _keys(values: Values) -> NDArray[np.uint64]:
    """Patterns in the order of the values: the sign bit flipped, all bits where it was set."""
    bits = np.ascontiguousarray(values).view(np.uint64)
    return np.where(bits >> np.uint64(63) == 1, ~bits, bits | np.uint64(1 << 63))


def _value(key: int) -> float:
    bits = key ^ (1 << 63) if key >> 63 else key ^ ((1 << 64) - 1)
    return float(np.uint64(bits).view(np.float64))
