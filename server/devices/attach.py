"""Connecting to network phones, disconnecting, and pairing, through this host's adb server."""

from __future__ import annotations

import contextlib
from typing import Protocol

from adbutils import AdbConnection, AdbError

from server.devices.adb import client
from server.devices.address import read_address, read_code
from server.devices.presence import ONLINE
from server.devices.words import plain

CONNECT_S = 20.0
PAIR_S = 30.0


class AttachError(RuntimeError):
    """A phone that cannot be connected to or paired with; the message is one sentence that says what to do."""


class Links(Protocol):
    """Network phones. Addresses and codes are checked ones; refusals are AttachError, other trouble ADB_ERRORS."""

    def connect(self, address: str) -> None:
        """Connect, or start to."""

    def disconnect(self, address: str) -> None:
        """Disconnect; nothing where nothing was connected."""

    def pair(self, address: str, code: str) -> None:
        """Pair."""


class AdbLinks:
    """The adb server that adbutils finds."""

    def connect(self, address: str) -> None:
        """Connect anew: adb calls a dead transport connected already."""
        if any(info.serial == address and info.state == ONLINE for info in client().list()):
            return
        self.disconnect(address)
        said = client().connect(read_address(address), timeout=CONNECT_S)
        # A phone that has yet to allow this host is connected, and unauthorized.
        if not said.startswith(("connected to ", "already connected to ", "failed to authenticate to ")):
            raise AttachError(f"Nothing answers there ({plain(said, 100)}): is it on, and its debugging over Wi-Fi?")

    def disconnect(self, address: str) -> None:
        """Disconnect."""
        with contextlib.suppress(AdbError):
            client().disconnect(read_address(address))

    def pair(self, address: str, code: str) -> None:
        """Pair over adb's own socket: on a command line the code could be read by others."""
        with client().make_connection(timeout=PAIR_S) as connection:
            connection.send_command(f"host:pair:{read_code(code)}:{read_address(address)}")
            connection.check_okay()
            said = _second_answer(connection)
        if not said.startswith("Successfully paired"):
            said = plain(said, 100).replace(code, "the code")
            raise AttachError(f"The phone did not pair ({said}): open Pair device with pairing code on it once more.")


def _second_answer(connection: AdbConnection) -> str:
    """What the server says once the phone has answered: its words, after FAIL where that was a refusal."""
    head = connection.read_string(4)
    return str(connection.read_string_block() if head == "FAIL" else connection.read_string(int(head, 16)))
