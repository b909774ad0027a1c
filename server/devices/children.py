"""Child processes that any thread may end at once."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

from renderer.child import run_child_async

Json = dict[str, Any]


class Ended(Exception):  # noqa: N818 - no error: somebody asked for it.
    """The children were told to end."""


class Children:
    """Runs child processes (`renderer.child`), each in the thread that asks for it, until `end`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: set[tuple[asyncio.AbstractEventLoop, asyncio.Task[Json]]] = set()
        self._over = False

    def run(self, module: str, task: Json, timeout_s: float) -> Json:
        """As `run_child`; raise Ended when `end` is called before or meanwhile. The child is gone by then."""
        try:
            return asyncio.run(self._run(module, task, timeout_s))
        except asyncio.CancelledError:
            raise Ended from None

    def end(self) -> None:
        """End all children, and refuse more."""
        with self._lock:
            self._over = True
            for loop, task in self._running:
                loop.call_soon_threadsafe(task.cancel)

    async def _run(self, module: str, task: Json, timeout_s: float) -> Json:
        work = asyncio.create_task(run_child_async(module, task, 1, timeout_s, _say_nothing))
        entry = (asyncio.get_running_loop(), work)
        with self._lock:
            self._running.add(entry)
            if self._over:
                work.cancel()
        try:
            return await work
        finally:
            with self._lock:
                self._running.discard(entry)


async def _say_nothing(_phase: str) -> None:
    pass
