"""Locks between the processes of one machine: one measurement at a time on it, and one on each phone.

They lie in the folder RAYFARM_LOCKS, else in the machine's folder for temporary files. Processes that each have one of
those to themselves, as in containers, must be given a common folder.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path


def lock_folder() -> Path:
    """Where the locks are."""
    return Path(os.environ.get("RAYFARM_LOCKS") or tempfile.gettempdir())


def machine_lock() -> Path:
    """The lock of this machine's processor, one for all its users: held by llvmpipe runs and our own heavy work."""
    return lock_folder() / "rayfarm-measuring.lock"


def device_lock(device: str) -> Path:
    """The lock of a device with this id."""
    return lock_folder() / f"rayfarm-device-{hashlib.sha256(device.encode()).hexdigest()[:16]}.lock"


@contextmanager
def holding(path: Path, when_busy: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Wait until nobody else holds the lock (after one call of `when_busy`), and hold it to the end of the block.

    The kernel frees it when the holding process is gone, however it ended. Raises RuntimeError where this thread holds
    it already, for it would wait for ever.
    """
    if path in _own.paths:
        raise RuntimeError(f"This thread holds {path.name} already: take it once, around all that needs it.")
    handle = _open(path)
    _own.paths.add(path)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            when_busy()
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        _own.paths.remove(path)
        os.close(handle)


class _Own(threading.local):
    """What a thread holds or waits for."""

    def __init__(self) -> None:
        self.paths: set[Path] = set()


_own = _Own()


def _open(path: Path) -> int:
    # Another user's file in a sticky folder may be opened for reading but not with O_CREAT; a lock needs no more.
    flags = os.O_RDONLY | os.O_CLOEXEC
    try:
        return os.open(path, flags)
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
        return os.open(path, flags | os.O_CREAT, 0o644)
