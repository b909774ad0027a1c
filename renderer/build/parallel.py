"""Compiled work on all cores: it runs without Python's lock, so threads do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TypeVar

Made = TypeVar("Made")


def threads() -> int:
    """How many cores this process may use, or what RAYFARM_BUILD_THREADS says."""
    return int(os.environ.get("RAYFARM_BUILD_THREADS") or len(os.sched_getaffinity(0)))


def each(tasks: Iterable[Callable[[], Made]]) -> list[Made]:
    """What the tasks return, in their order. Who runs them changes nothing, so equal input gives equal bytes."""
    count = threads()
    if count == 1:
        return [task() for task in tasks]
    return list(_pool(count).map(lambda task: task(), tasks))


@lru_cache
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="build")
