"""Whose turn it is, of several workers on one machine, to follow its devices."""

from __future__ import annotations

import fcntl
import hashlib
import os

from renderer.locks import lock_folder


class Turn:
    """One holder at a time for each name; the kernel ends a turn with its process, however that ended."""

    def __init__(self, name: str) -> None:
        digest = hashlib.sha256(name.encode()).hexdigest()[:16]
        self._path = lock_folder() / f"rayfarm-tracker-{os.getuid()}-{digest}.lock"
        self._handle: int | None = None

    def take(self) -> bool:
        """Take it if it is free; whether it is held now."""
        if self._handle is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(self._path, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                return False
            self._handle = handle
        return True

    def give(self) -> None:
        """Give it back."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None
