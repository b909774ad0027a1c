"""Verbs of the CLI as child processes, started and ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from types import FrameType


def signalled() -> threading.Event:
    """An event that SIGTERM and SIGINT set from now on, instead of what they did."""
    told = threading.Event()

    def handle(_number: int, _frame: FrameType | None) -> None:
        told.set()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, handle)
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
