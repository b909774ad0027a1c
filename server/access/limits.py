"""How many submissions a client may send: a token bucket for each, in this process's memory."""

from __future__ import annotations

import time
from collections.abc import Callable

MOST_CLIENTS = 10_000


class Limit:
    """At most `per_minute` at once and in the long run; 0 sets no limit."""

    def __init__(self, per_minute: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._most = per_minute
        self._clock = clock
        self._left: dict[str, tuple[float, float]] = {}

    def wait_s(self, client: str) -> float:
        """Take one of a client's submissions: 0, or the seconds until it has one again."""
        if not self._most:
            return 0.0
        at = self._clock()
        left, since = self._left.pop(client, (float(self._most), at))
        left = min(float(self._most), left + (at - since) * self._most / 60)
        taken = left >= 1
        self._left[client] = (left - taken, at)
        if len(self._left) > MOST_CLIENTS:
            del self._left[next(iter(self._left))]
        return 0.0 if taken else (1 - left) * 60 / self._most
