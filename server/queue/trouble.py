"""A database that does not answer: said once when it goes and once when it is back, and waited for."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import TypeVar

from server.store.errors import AWAY, shortly

Returned = TypeVar("Returned")

AGAIN_S = 1.0


class Trouble:
    """What one thread, or one piece of work, has seen of the database."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._lasts = False

    def seen(self, error: Exception) -> None:
        """The database does not answer."""
        if not self._lasts:
            self._log.warning("the database does not answer, which is waited for: %s", shortly(error))
        self._lasts = True

    def over(self) -> bool:
        """The database answered; whether it had not before."""
        lasted, self._lasts = self._lasts, False
        if lasted:
            self._log.info("the database answers again")
        return lasted


def patiently(ask: Callable[[], Returned], ended: threading.Event, log: logging.Logger) -> Returned:
    """What `ask` returns, asked again for as long as the database is away; raise what it raises once `ended` is set.

    `ask` is one transaction, and may find that an earlier try was carried out after all.
    """
    trouble = Trouble(log)
    while True:
        try:
            answer = ask()
        except AWAY as error:
            trouble.seen(error)
            if ended.wait(AGAIN_S):
                raise
        else:
            trouble.over()
            return answer
