"""Work in a fresh child process: the parent's end of it; `renderer.answering` is the child's.

Between them stands `renderer.leash`, which ends the child in time.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

from renderer.answering import Json, Say, silent
from renderer.host import DeviceGoneError

AsyncSay = Callable[[str], Awaitable[None]]

LEASE_S = 60.0
"""A child ends when its parent gave no sign of life for this long."""
MAX_LINE = 256 << 20


class ChildError(RuntimeError):
    """A child that gave no answer; the message is one sentence."""


def run_child(module: str, task: Json, threads: int, timeout_s: float, say: Say = silent, note: Say = silent) -> Json:
    """Run `python -m module` on a task with `threads` rasteriser threads and return its answer; `note` gets its notes.

    The child ends with this process. Raise ChildError with its reason when it fails or works for longer than
    `timeout_s` seconds (its phase `waiting` does not count), DeviceGoneError when its device went away.
    """

    async def tell(phase: str) -> None:
        say(phase)

    async def take(text: str) -> None:
        note(text)

    return asyncio.run(run_child_async(module, task, threads, timeout_s, tell, note=take))


async def silent_async(_text: str) -> None:
    """Say nothing."""


async def run_child_async(
    module: str,
    task: Json,
    threads: int,
    timeout_s: float,
    say: AsyncSay,
    *,
    note: AsyncSay = silent_async,
    lease_s: float = LEASE_S,
    has_lease: Callable[[], bool] = lambda: True,
    memory_mb: int | None = None,
) -> Json:
    """The same, to be cancelled: the child is gone before the cancellation goes on.

    The child is also ended when this process is stopped, or `has_lease` has been false, for `lease_s` seconds; that
    raises DeviceGoneError. It may take `memory_mb` megabytes of memory.
    """
    limits = {"timeout_s": timeout_s, "lease_s": lease_s, "memory_mb": memory_mb}
    order = {"parent": os.getpid(), "module": module, "task": task, **limits}
    async with _leashed(order, threads) as leash:
        assert leash.stdin is not None
        assert leash.stdout is not None
        pulse = asyncio.create_task(_pulse(leash.stdin, lease_s / 4, has_lease))
        try:
            return await _follow(leash.stdout, say, note)
        finally:
            pulse.cancel()


@asynccontextmanager
async def _leashed(order: Json, threads: int) -> AsyncIterator[asyncio.subprocess.Process]:
    leash = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "renderer.leash",
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        env=os.environ | {"LP_NUM_THREADS": str(threads), "PYTHONUNBUFFERED": "1"},
        limit=MAX_LINE,
    )
    assert leash.stdin is not None
    try:
        leash.stdin.write(json.dumps(order).encode() + b"\n")
        yield leash
    finally:
        # At the end of its input the leash ends its child, waits for it, and goes; however often this is cancelled.
        leash.stdin.close()
        gone = asyncio.ensure_future(leash.wait())
        while not gone.done():
            with suppress(asyncio.CancelledError):
                await asyncio.shield(gone)


async def _pulse(to: asyncio.StreamWriter, every_s: float, has_lease: Callable[[], bool]) -> None:
    while True:
        await asyncio.sleep(every_s)
        if has_lease():
            to.write(b"\n")


async def _follow(source: asyncio.StreamReader, say: AsyncSay, note: AsyncSay) -> Json:
    last: Json = {"error": "The run ended without an answer.", "gone": False}
    async for line in source:
        message = _read(line)
        if "phase" in message:
            await say(message["phase"])
        elif "note" in message:
            await note(message["note"])
        elif message:
            last = message
    if "answer" in last:
        answer: Json = last["answer"]
        return answer
    raise (DeviceGoneError if last["gone"] else ChildError)(last["error"])


def _read(line: bytes) -> Json:
    """A message, or an empty one for what a library printed."""
    try:
        message = json.loads(line)
    except ValueError:
        return {}
    known = isinstance(message, dict) and message.keys() & {"phase", "note", "answer", "error"}
    return message if known else {}
