"""Locks between processes: a thread waits for others, and never for itself."""

from __future__ import annotations

import fcntl
import threading
from pathlib import Path

import pytest

from renderer.locks import holding

WAIT_S = 20.0


def test_a_thread_that_asks_for_what_it_holds_is_told(tmp_path: Path) -> None:
    lock = tmp_path / "some.lock"
    with holding(lock):
        with pytest.raises(RuntimeError, match=r"holds some\.lock already"), holding(lock):
            pass
        assert _is_held(lock)
        with holding(tmp_path / "other.lock"):
            pass
    assert not _is_held(lock)


def test_another_thread_waits(tmp_path: Path) -> None:
    lock, waits, got = tmp_path / "some.lock", threading.Event(), threading.Event()

    def take() -> None:
        with holding(lock, waits.set):
            got.set()

    other = threading.Thread(target=take, daemon=True)
    with holding(lock):
        other.start()
        assert waits.wait(WAIT_S)
        assert not got.is_set()
    assert got.wait(WAIT_S)
    other.join(WAIT_S)


def _is_held(lock: Path) -> bool:
    with lock.open() as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        return False
