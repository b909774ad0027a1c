"""What a check found."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

State = Literal["good", "note", "missing"]


@dataclass(frozen=True)
class Finding:
    """One sentence of a check: a `note` may be left as it is, what is `missing` must be mended."""

    check: str
    state: State
    sentence: str


Check = Callable[[], Iterable[Finding]]
Said = tuple[State, str]
"""A finding of the check at hand."""


def findings(check: str, said: Iterable[Said]) -> list[Finding]:
    """What one check says, under its name."""
    return [Finding(check, state, sentence) for state, sentence in said]
