"""What the agent prints while it runs: its phases, a line each. Shown to people, and trusted for nothing."""

from __future__ import annotations

import re

from server.devices.wire import STDERR, STDOUT
from server.devices.words import plain

_MAX_LINE = 128
_MAX_TAIL = 2048
_PHASE = re.compile(rb"rayfarm ((?:ready|compiled|done|torn)|frame [0-9]{1,7})\r?")


class AgentWords:
    """Listens to one run, within bounds however much a phone prints."""

    def __init__(self) -> None:
        self.phase = "nothing"
        self._line = b""
        self._errors = b""

    def hear(self, kind: int, piece: bytes) -> None:
        """Take a piece of STDOUT or STDERR."""
        if kind == STDERR:
            self._errors = (self._errors + piece)[-_MAX_TAIL:]
        if kind != STDOUT:
            return
        *lines, rest = (self._line + piece).split(b"\n")
        for line in lines:
            said = _PHASE.fullmatch(line)
            if said is not None:
                self.phase = said[1].decode()
        # Of a longer line so much is kept as shows that it is no phase.
        self._line = rest[:_MAX_LINE]

    @property
    def last_error(self) -> str:
        """The last line on standard error, made plain."""
        lines = [plain(line) for line in self._errors.splitlines()]
        return next((line for line in reversed(lines) if line), "nothing on standard error")
