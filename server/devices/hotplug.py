"""Follows what is attached to this host's adb server, through adbutils' `track_devices`."""

from __future__ import annotations

import contextlib
import logging
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from adbutils import AdbClient, AdbConnection, AdbError

from server.devices.adb import client
from server.devices.presence import ONLINE
from server.devices.words import plain

log = logging.getLogger("rayfarm.devices")

States = dict[str, str]
"""adb's state of each phone that it lists, by serial."""
Told = Callable[[States | None, set[str]], None]
"""Told the states (None: no adb server can be had) and the serials that were gone in between, at each change."""

ADB_ERRORS = (AdbError, OSError, subprocess.SubprocessError, EOFError, ValueError)
"""What adbutils raises; a ValueError when an answer is cut short or no number."""


STEADY_S = 5.0
"""An adb server that was there for this long is looked for again at once when it goes."""


class Adb(Protocol):
    """An adb server, as the watcher needs it. All methods raise ADB_ERRORS."""

    def states(self) -> States:
        """What is attached now."""

    def changes(self) -> Iterator[Any]:
        """An item (adbutils' DeviceEvent) for each change from now on, first for what is attached already."""

    def cut(self) -> None:
        """End `changes`, from any thread, also if it begins later."""


class AdbServer:
    """The adb server that adbutils finds, and starts where there is none."""

    def __init__(self) -> None:
        self._tracking = _CutClient()

    def states(self) -> States:
        """What is attached now."""
        return {info.serial: info.state for info in client().list()}

    def changes(self) -> Iterator[Any]:
        """adbutils' `track_devices`."""
        events: Iterator[Any] = self._tracking.track_devices()
        return events

    def cut(self) -> None:
        """Close the connection under `track_devices`."""
        self._tracking.cut()


class _CutClient(AdbClient):  # type: ignore[misc]
    """A client whose connections can be cut while another thread reads from one."""

    def __init__(self) -> None:
        super().__init__()
        self._lock, self._cut = threading.Lock(), False
        self._connection: AdbConnection | None = None

    def make_connection(self, timeout: float | None = None) -> AdbConnection:
        connection = super().make_connection(timeout)
        with self._lock:
            self._connection = connection
            if self._cut:
                self._shut()
        return connection

    def cut(self) -> None:
        with self._lock:
            self._cut = True
            self._shut()

    def _shut(self) -> None:
        if self._connection is not None and not self._connection.closed:
            with contextlib.suppress(OSError):
                self._connection.conn.shutdown(socket.SHUT_RDWR)


class Watcher:
    """A thread that tells what is attached, as long as it runs. It survives adb servers."""

    def __init__(self, adb: Adb, tell: Told, patience_s: tuple[float, float] = (0.2, 60.0)) -> None:
        """`patience_s`: the first and the longest wait between two attempts to have an adb server."""
        self._adb, self._tell = adb, tell
        self._shortest_s, self._longest_s = patience_s
        self._stop = threading.Event()
        self._answered = self._quiet = False
        self._thread = threading.Thread(target=self._run, name="adb-watcher", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """End, and wait for the end for so long: an adb server that is being started is not waited for."""
        self._stop.set()
        self._adb.cut()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        wait_s = self._shortest_s
        while not self._stop.is_set():
            self._answered, begun = False, time.monotonic()
            try:
                self._follow()
            except ADB_ERRORS as error:
                if not self._answered and not self._stop.is_set():
                    self._say_none(error)
            steady = self._answered and time.monotonic() - begun > STEADY_S
            wait_s = self._shortest_s if steady else min(2 * wait_s, self._longest_s)
            self._stop.wait(wait_s)

    def _follow(self) -> None:
        before = self._adb.states()
        self._answered, self._quiet = True, False
        # Whatever was online may have gone with the server before this one.
        self._tell(before, set(before))
        for event in self._adb.changes():
            gone = {event.serial} if not event.present and before.get(event.serial) == ONLINE else set()
            before = self._adb.states()
            self._tell(before, gone)

    def _say_none(self, error: BaseException) -> None:
        self._tell(None, set())
        if not self._quiet:
            log.warning("No adb server can be had, so no phones: %s", plain(error))
            self._quiet = True
