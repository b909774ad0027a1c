"""Whether who opened a stream may still see it: a token can end while its stream goes on."""

from __future__ import annotations

import time

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from server.access import tokens
from server.access.middleware import HOLDER
from server.access.tokens import Holder
from server.store.database import Database
from server.store.errors import AWAY

CHECK_S = 5.0
"""For how long one look at a token is good."""
ENDED = "This token has expired or was revoked: ask for another."


class Stay:
    """The stay of a request's holder; nobody's, where no token was sent and none was needed, lasts."""

    def __init__(self, request: Request, database: Database) -> None:
        self._holder: Holder | None = request.scope.get(HOLDER)
        self._database = database
        self._looked_at = time.monotonic()
        self._good = True

    async def lasts(self) -> bool:
        """Whether the token is still good, as of `CHECK_S` seconds ago at most.

        While the database is away it counts as it was: what a stream tells comes from there, too.
        """
        if self._holder is not None and self._good and time.monotonic() - self._looked_at >= CHECK_S:
            try:
                self._good = await run_in_threadpool(tokens.still_good, self._database, self._holder)
            except AWAY:
                return True
            self._looked_at = time.monotonic()
        return self._good
