"""Work on all cores: what is compiled, and most of numpy, runs without Python's lock, so threads do."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import lru_cache, partial
from typing import TypeVar

from renderer.build.progress import Told, untold

Made = TypeVar("Made")

_BLOCK = 1 << 14


def threads() -> int:
    """How many cores this process may use, or what RAYFARM_BUILD_THREADS says."""
    return int(os.environ.get("RAYFARM_BUILD_THREADS") or len(os.sched_getaffinity(0)))


def each(tasks: Sequence[Callable[[], Made]], told: Told = untold) -> list[Made]:
    """What the tasks return, in their order. Who runs them changes nothing, so equal input gives equal bytes."""
    count, made = threads(), list[Made]()
    # numpy.errstate is of a context, not of a process.
    placed = [partial(copy_context().run, task) for task in tasks]
    for one in map(_run, placed) if count == 1 else _pool(count).map(_run, placed):
        made.append(one)
        told(len(made) / len(tasks))
    return made


def blocks(count: int) -> list[slice]:
    """Rows up to `count` in blocks: to be handed memory for temporaries of a million takes longer than to fill it."""
    return [slice(begin, min(begin + _BLOCK, count)) for begin in range(0, count, _BLOCK)]


def _run(task: Callable[[], Made]) -> Made:
    return task()


@lru_cache
def _pool(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="build")
