"""A phone over adb: its shell and its files, with every answer bounded and every way to fail in one sentence."""

from __future__ import annotations

import os
import shlex
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO

from adbutils import AdbClient, AdbConnection, AdbError

from renderer.host import DeviceGoneError
from renderer.plan import PlanError
from server.devices.wire import (
    EXIT,
    STDERR,
    STDOUT,
    BrokenError,
    RefusedError,
    Wire,
    receive_file,
    send_file,
    shell_output,
)
from server.devices.words import WordError, plain, require_path, require_serial

PATIENCE_S = 20.0
"""A phone that takes or says nothing for this long, while it should, counts as gone."""

MAX_ANSWER = 1 << 16
"""Bytes kept of a command's answer; the rest is read and dropped."""


class PhoneError(PlanError):
    """Something that a phone, present, could not or would not do; the message is one sentence."""


@dataclass(frozen=True)
class Said:
    """What a command said, each at most the bytes asked for, and its exit code."""

    stdout: bytes
    stderr: bytes
    code: int


def client() -> AdbClient:
    """A client of the adb server at ANDROID_ADB_SERVER_PORT, or at adb's own port; the server is started if need be."""
    given = os.environ.get("ANDROID_ADB_SERVER_PORT", "5037")
    if not given.isdecimal() or not 0 < int(given) < 65536:
        raise WordError(f"ANDROID_ADB_SERVER_PORT is {plain(given)!r}: give the port of an adb server.")
    return AdbClient(port=int(given))


class Phone:
    """One phone by its serial. Every method raises DeviceGoneError when the phone went away, saying while doing what
    (`doing`: a phrase like "pushing the plan"), and PhoneError for what it refused."""

    def __init__(self, serial: str, patience_s: float = PATIENCE_S) -> None:
        """Raise WordError for what is no serial. Nothing is sent yet."""
        self.serial = require_serial(serial)
        self._client = client()
        self._patience_s = patience_s

    def run(self, script: str, *words: str, doing: str, timeout_s: float = 30.0, most: int = MAX_ANSWER) -> Said:
        """Run a script of our own with `words` as $1, $2, ... and wait for its end."""
        kept = {STDOUT: bytearray(), STDERR: bytearray()}
        code = b"\xff"
        with self.shell(script, *words, doing=doing) as wire:
            wire.until = time.monotonic() + timeout_s
            for kind, piece in shell_output(wire):
                if kind == EXIT:
                    code = piece
                elif kind in kept:
                    kept[kind] += piece[: most - len(kept[kind])]
        return Said(bytes(kept[STDOUT]), bytes(kept[STDERR]), code[0])

    @contextmanager
    def shell(self, script: str, *words: str, doing: str) -> Iterator[Wire]:
        """The open shell of a script; its process's standard input ends with the block."""
        command = f"set -- {shlex.join(words)}\n{script}" if words else script
        with self._open(f"shell,v2,raw:{command}", doing) as wire:
            yield wire

    def push(self, source: IO[bytes], remote: str, doing: str) -> None:
        """Copy a file to the phone, as large as it may be."""
        require_path(remote)
        with self._open("sync:", doing) as wire:
            try:
                send_file(wire, source, remote)
            except RefusedError as reason:
                raise PhoneError(f"The phone {self.serial} failed while {doing}: {reason}.") from reason

    def pull(self, remote: str, target: IO[bytes], doing: str, most: int) -> int:
        """Copy a file of at most `most` bytes from the phone; return its size."""
        require_path(remote)
        with self._open("sync:", doing) as wire:
            try:
                return receive_file(wire, remote, target, most)
            except RefusedError as reason:
                raise PhoneError(f"The phone {self.serial} failed while {doing}: {reason}.") from reason

    @contextmanager
    def _open(self, service: str, doing: str) -> Iterator[Wire]:
        try:
            connection = self._connect(service)
        except (AdbError, OSError, ValueError, subprocess.SubprocessError) as error:
            raise self._gone(doing, plain(error)) from error
        try:
            yield Wire(connection, self._patience_s)
        except BrokenError as error:
            raise self._gone(doing, str(error)) from error
        finally:
            connection.close()

    def _connect(self, service: str) -> AdbConnection:
        connection = self._client.make_connection(timeout=self._patience_s)
        try:
            # Small packets must not wait for each other's acknowledgement.
            connection.conn.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for request in (f"host:transport:{self.serial}", service):
                data = request.encode()
                connection.conn.sendall(f"{len(data):04x}".encode() + data)
                connection.check_okay()
        except BaseException:
            connection.close()
            raise
        return connection

    def _gone(self, doing: str, detail: str) -> DeviceGoneError:
        if "unauthorized" in detail or "authorizing" in detail:
            return DeviceGoneError(f"The phone {self.serial} does not trust this computer: unlock it and tap Allow.")
        return DeviceGoneError(f"The phone {self.serial} went away while {doing} ({detail}).")
