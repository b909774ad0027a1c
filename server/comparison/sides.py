"""One side of a comparison of two: `job:12`, `study:3`, a file of results, or a selection, as its user writes it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.comparison.derived import DERIVED, read_derived
from server.comparison.differences import FIXED, SETUP, setup_of

STORED = ("job", "study")
MAX_ID = 2**31 - 1
GRAMMAR = (
    "write it as job:12, study:3, results.jsonl or scene=forest, with ,layout=normal after it to choose among them"
)


class SideError(ValueError):
    """A side that is not understood or holds nothing; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Side:
    """Where results come from, and which of them.

    `kind` is `job` or `study` with `number`, `file` with `path`, or `all` stored results; `filters` choose by SETUP.
    """

    text: str
    kind: str
    number: int
    path: str
    filters: dict[str, str]


def read_side(text: str) -> Side:
    """Read `SOURCE[,NAME=VALUE]...` or `NAME=VALUE[,NAME=VALUE]...`; raise SideError."""
    first, *rest = _words(text)
    kind, colon, number = first.partition(":")
    if colon and kind in STORED:
        if not (number.isascii() and number.isdigit() and 0 < int(number[:20]) <= MAX_ID):
            raise SideError(f"The number in {first!r} is not understood: {GRAMMAR}.")
        return Side(text, kind, int(number), "", _filters(rest))
    if first.partition("=")[0] in SETUP:
        return Side(text, "all", 0, "", _filters([first, *rest]))
    if not first:
        raise SideError(f"A side of the comparison is empty: {GRAMMAR}.")
    return Side(text, "file", 0, first, _filters(rest))


def compared_names(baseline: Side, against: Side) -> set[str]:
    """What both sides choose by, which is what is compared."""
    return set(baseline.filters) & set(against.filters) - set(FIXED)


def choose(side: Side, results: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The results that a side's filters let through; raise SideError when there are none."""
    wanted = side.filters.items()
    chosen = [result for result in results if wanted <= setup_of(result).items()]
    if not chosen:
        raise SideError(f"There is no result in {side.text!r}: {GRAMMAR}.")
    return chosen


def read_results(path: str) -> list[dict[str, Any]]:
    """The results in a file of JSON Lines as `bench --json` and `study --output` write it; raise SideError."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
        results = [json.loads(line) for line in lines if line.strip()]
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise SideError(f"Cannot read {path!r} ({reason}): {GRAMMAR}.") from error
    except ValueError as error:
        raise SideError(
            f"{path!r} is no JSON Lines: write it with `rayfarm bench --json` or `study --output`."
        ) from error
    if not all(isinstance(result, dict) and "scene" in result and "frames_ms" in result for result in results):
        raise SideError(f"{path!r} holds no results: write it with `rayfarm bench --json` or `study --output`.")
    return results


def _words(text: str) -> list[str]:
    """A side's words; the comma between SAH costs (`sah=3.0,1.5`) parts none."""
    words: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if words and words[-1].startswith("sah=") and "," not in words[-1] and "=" not in word:
            words[-1] += f",{word}"
        else:
            words.append(word)
    return words


def _filters(words: Iterable[str]) -> dict[str, str]:
    filters: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or name not in SETUP:
            raise SideError(f"The filter {word!r} is not understood: write NAME=VALUE with one of {', '.join(SETUP)}.")
        filters[name] = read_derived(name, value) if name in DERIVED else value
    return filters
