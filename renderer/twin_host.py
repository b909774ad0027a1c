"""The twin as a host: one EGL context on this machine's processor or GPU."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer.host import WARM_UP, Tile, Timed
from renderer.locks import machine_lock
from renderer.plan import Plan
from renderer.twin import Twin, open_context


class TwinHost:
    """Runs plans here, in this process."""

    paces = True

    def __init__(self, threads: int) -> None:
        """Note how many rasteriser threads llvmpipe was given; the context is made when it is first needed."""
        self._threads = threads
        self._made: Any = None

    @property
    def lock(self) -> Path:
        """The machine's: the processor is the device."""
        return machine_lock()

    def device(self) -> dict[str, Any]:
        """What EGL says of itself, and what it runs on."""
        return describe(self._context(), self._threads)

    def collect(self, plan: Plan) -> list[Tile]:
        """Run one frame of an instrumented plan."""
        twin = Twin(self._context(), plan)
        twin.setup()
        tiles = twin.collect()
        twin.release()
        return tiles

    def measure(self, plan: Plan, frames: int, between: Callable[[], None]) -> Timed:
        """Time frames."""
        context = self._context()
        begun = time.perf_counter()
        twin = Twin(context, plan)
        twin.setup()
        for _ in range(WARM_UP):
            twin.frame()
        compile_s = time.perf_counter() - begun
        times = twin.time_frames(frames, between)
        timed = Timed(times, compile_s, twin.image())
        twin.release()
        return timed

    def _context(self) -> Any:
        if self._made is None:
            self._made = open_context()
        return self._made


def describe(context: Any, threads: int) -> dict[str, Any]:
    """What a context says of its device, and what that runs on."""
    info = context.info
    return {
        "id": "llvmpipe" if "llvmpipe" in info["GL_RENDERER"] else "egl",
        "kind": "twin",
        "name": info["GL_RENDERER"],
        "driver": info["GL_VERSION"],
        "vendor": info["GL_VENDOR"],
        "threads": threads,
        "cores": os.cpu_count(),
        "machine": platform.machine(),
    }
