"""This host and its processes: one measurement at a time, and children that end with their parent."""

from __future__ import annotations

import ctypes
import fcntl
import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PR_SET_PDEATHSIG = 1


def lock_path() -> Path:
    """The lock's file, one for all users of this host."""
    return Path(tempfile.gettempdir()) / "rayfarm-measuring.lock"


@contextmanager
def measuring(path: Path | None = None) -> Iterator[None]:
    """Wait until nothing else is measured on this host, and hold the host until the end of the block."""
    handle = _open(path or lock_path())
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def end_with_parent(parent: int, how: int = signal.SIGKILL) -> None:
    """Ask the kernel to end this process when process `parent` does; call it from the main thread.

    Linux only; elsewhere the parent's own clean-up has to do.
    """
    if not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, how)
    if os.getppid() != parent:
        raise SystemExit(0)


def _open(path: Path) -> int:
    # Another user's file in a sticky folder may be opened for reading but not with O_CREAT; a lock needs no more.
    flags = os.O_RDONLY | os.O_CLOEXEC
    try:
        return os.open(path, flags)
    except FileNotFoundError:
        return os.open(path, flags | os.O_CREAT, 0o644)
