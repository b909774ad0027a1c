"""Words that go to a phone, and words that come from one.

The phone's shell parses a command line again, whatever was quoted here, so serials, packages and paths come from a
small alphabet. What a phone says of itself is anyone's text: it is cut short and loses what could steer a terminal.
"""

from __future__ import annotations

import re
import unicodedata
from typing import Any

from renderer.plan import PlanError

MAX_TEXT = 160
"""Characters kept of one thing that a phone says."""

# USB serials, HOST:PORT, [IPv6]:PORT, emulator-5554, and mDNS names (adb-SERIAL-abcdef._adb-tls-connect._tcp).
_SERIAL = re.compile(r"[A-Za-z0-9\[][A-Za-z0-9._:\-\[\]%]{0,127}")
_PACKAGE = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}(\.[A-Za-z][A-Za-z0-9_]{0,63}){1,7}")
_PATH = re.compile(r"(/[A-Za-z0-9@_+,:=.\-]{1,128}){1,16}")


class WordError(PlanError):
    """A serial, package or path that is not sent to a phone; the message is one sentence."""


def require_serial(text: str) -> str:
    """The serial; raise WordError unless it is one."""
    if not _SERIAL.fullmatch(text):
        raise WordError(f"{plain(text)!r} is no phone's serial: give one that `adb devices` lists.")
    return text


def require_package(text: str) -> str:
    """The name of an Android package; raise WordError unless it is one."""
    if not _PACKAGE.fullmatch(text):
        raise WordError(f"{plain(text)!r} is no Android package: give a name like org.example.app.")
    return text


def require_path(text: str) -> str:
    """An absolute path on a phone; raise WordError unless it is one without `..` and special characters."""
    if not _PATH.fullmatch(text) or ".." in text.split("/"):
        raise WordError(f"{plain(text)!r} is no path for a phone: give an absolute one of plain letters.")
    return text


def plain(said: Any, limit: int = MAX_TEXT) -> str:
    """What a phone said as one line of at most `limit` characters, without control and format characters."""
    text = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
    kept = "".join(" " if _unsafe(character) else character for character in text[: 8 * limit])
    line = " ".join(kept.split())
    return line if len(line) <= limit else line[: limit - 1] + "…"


def _unsafe(character: str) -> bool:
    """Control, format (bidirectional overrides among them), surrogate, private and unassigned; line separators."""
    kind = unicodedata.category(character)
    return kind[0] == "C" or kind in ("Zl", "Zp")
