"""Bytes to and from one service of a phone: the shell protocol (version 2) and the sync protocol, read within bounds.

adbutils opens the services; its own readers keep whatever a phone sends and its writers do not finish a short write,
so the few packets that are needed are read and written here (AOSP, `adb/shell_protocol.h`, `adb/SYNC.TXT`).
"""

from __future__ import annotations

import math
import socket
import struct
import time
from collections.abc import Iterator
from typing import IO, Protocol

from server.devices.words import plain

STDOUT, STDERR, EXIT = 1, 2, 3
_CHUNK = 1 << 16
_MAX_SENTENCE = 1024


class RefusedError(Exception):
    """The phone answered, and it refuses: its own words, made plain."""


class BrokenError(Exception):
    """The phone, or the adb server, went away or stopped answering."""


class OverdueError(BrokenError):
    """The time that a service was given is over."""


class Connection(Protocol):
    """What adbutils opens."""

    @property
    def conn(self) -> socket.socket:
        """The socket to the adb server."""


class Wire:
    """One open service. Reading and writing raise BrokenError when the phone went away or says nothing for
    `patience_s` seconds, OverdueError when `until` (of `time.monotonic`) has come."""

    def __init__(self, connection: Connection, patience_s: float) -> None:
        self._socket = connection.conn
        self.patience_s = patience_s
        self.until = math.inf

    def write(self, data: bytes) -> None:
        """Write all of it."""
        self._set_timeout()
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise self._broken(error) from error

    def read(self, count: int) -> bytes:
        """Exactly `count` bytes."""
        data = bytearray()
        while len(data) < count:
            data += self._receive(count - len(data))
        return bytes(data)

    def pieces(self, count: int) -> Iterator[bytes]:
        """`count` bytes in pieces, however many a phone says there are."""
        while count:
            piece = self._receive(min(count, _CHUNK))
            count -= len(piece)
            yield piece

    def _receive(self, most: int) -> bytes:
        self._set_timeout()
        try:
            data = self._socket.recv(most)
        except OSError as error:
            raise self._broken(error) from error
        if not data:
            raise BrokenError("the connection ended")
        return data

    def _set_timeout(self) -> None:
        left = self.until - time.monotonic()
        if left <= 0:
            raise OverdueError("it took too long")
        timeout = min(left, self.patience_s)
        self._socket.settimeout(None if math.isinf(timeout) else timeout)

    def _broken(self, error: OSError) -> BrokenError:
        if not isinstance(error, TimeoutError):
            return BrokenError(plain(error))
        if time.monotonic() >= self.until:
            return OverdueError("it took too long")
        return BrokenError(f"nothing was heard for {self.patience_s:g} s")


def shell_output(wire: Wire) -> Iterator[tuple[int, bytes]]:
    """What a shell says, piece by piece, as (STDOUT or STDERR, bytes), and last (EXIT, the code's byte).

    A stream without an EXIT ends in BrokenError: the phone went away, not the process.
    """
    while True:
        kind, length = struct.unpack("<BI", wire.read(5))
        for piece in wire.pieces(length):
            yield kind, piece
        if kind == EXIT:
            return


def send_file(wire: Wire, source: IO[bytes], path: str) -> None:
    """Write a file, readable by all; raise RefusedError with the phone's reason."""
    target = f"{path},{0o100644}".encode()
    wire.write(struct.pack("<4sI", b"SEND", len(target)) + target)
    while chunk := source.read(_CHUNK):
        wire.write(struct.pack("<4sI", b"DATA", len(chunk)) + chunk)
    wire.write(struct.pack("<4sI", b"DONE", int(time.time())))
    word, length = struct.unpack("<4sI", wire.read(8))
    _check_sync(word, length, wire)


def receive_file(wire: Wire, path: str, target: IO[bytes], most: int) -> int:
    """Read a file of at most `most` bytes and return its size; raise RefusedError with the reason."""
    name = path.encode()
    wire.write(struct.pack("<4sI", b"RECV", len(name)) + name)
    size = 0
    while True:
        word, length = struct.unpack("<4sI", wire.read(8))
        if word == b"DONE":
            return size
        if word != b"DATA":
            _check_sync(word, length, wire)
            raise RefusedError("it answered with something else than a file")
        size += length
        if size > most:
            raise RefusedError(f"the file is larger than the {most} bytes that it may have")
        for piece in wire.pieces(length):
            target.write(piece)


def _check_sync(word: bytes, length: int, wire: Wire) -> None:
    if word == b"FAIL":
        raise RefusedError(plain(wire.read(min(length, _MAX_SENTENCE))))
    if word != b"OKAY":
        raise RefusedError("it answered with something that is not of the protocol")
