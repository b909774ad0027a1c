"""Processes that end with the one that started them."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def end_with_parent(parent: int, how: int = signal.SIGKILL) -> None:
    """Ask the kernel to end this process when process `parent` does; call it from the main thread.

    It fires when the thread that started this process ends. Linux only; elsewhere the parent's own clean-up has to do.
    """
    if not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, how)
    if os.getppid() != parent:
        raise SystemExit(0)
