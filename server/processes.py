"""Verbs of the CLI as child processes, started and ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from queue import Empty, SimpleQueue
from types import FrameType


class Told:
    """Whether this process was told to end, for its main thread.

    A handler runs in the main thread, between any two steps of it. So it must take no lock that this thread may hold,
    as that of a `threading.Event` is while it waits; putting something into a `SimpleQueue` takes none.
    """

    def __init__(self) -> None:
        self._signals = SimpleQueue[int]()
        self._told = False

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """Handle a signal."""
        self._signals.put(number)

    def wait(self, timeout: float | None = None) -> bool:
        """Whether it was told by now, after at most `timeout` seconds."""
        if not self._told:
            try:
                self._signals.get(timeout=timeout)
                self._told = True
            except Empty:
                pass
        return self._told


def signalled() -> Told:
    """What SIGTERM and SIGINT tell from now on, instead of what they did."""
    told = Told()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, told.handle)
    return told


def start_verb(*words: str) -> subprocess.Popen[bytes]:
    """Start `rayfarm WORDS` as a child that ends with this process; call it from a thread that lives as long.

    It has a session of its own: an interrupt from the keyboard reaches this process alone, which then ends the child.
    """
    command = [sys.executable, "-m", "server.cli.app", *words, "--parent", str(os.getpid())]
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)


def stop(child: subprocess.Popen[bytes], patience_s: float = 15.0) -> None:
    """End a child and wait for it; after `patience_s` seconds it is killed."""
    if child.poll() is None:
        child.terminate()
        try:
            child.wait(patience_s)
        except subprocess.TimeoutExpired:
            child.kill()
    child.wait()
