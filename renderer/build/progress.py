"""How far a build is, told to whoever waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable

Told = Callable[[float], None]
"""Told the share of the work that is done, from 0 to 1."""

EVERY_S = 1.0

TOP_SHARE = 0.3
"""About how much of a large build's time passes before there are tasks to share out."""


def untold(_share: float) -> None:
    """Tell nobody."""


def within(told: Told, begin: float, end: float) -> Told:
    """What a part of the work tells: its own share, which goes from `begin` to `end` of the whole."""
    return lambda share: told(begin + (end - begin) * share)


def sentences(what: str, say: Callable[[str], None]) -> Told:
    """Says in words how much of `what` is done, a second after this call and then once a second at most."""
    last = time.monotonic()

    def told(share: float) -> None:
        nonlocal last
        if time.monotonic() - last >= EVERY_S:
            last = time.monotonic()
            say(f"{what}: {100.0 * share:.0f} %")

    return told
