"""Holds one child process on a leash (`python -m renderer.leash`); `renderer.child` speaks to both.

The child ends when its time is over, and when the process above is gone or gives no sign of life (a line on standard
input) for a lease: a stopped worker's child must not run on while its job is handed to another. It imports nothing
heavy, and it is a process of its own, because the child may sit in a driver's call that lets no thread of it run.
"""

from __future__ import annotations

import errno
import json
import os
import re
import resource
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from typing import IO, Any

from renderer.process import end_with_parent

NO_LEASE = "The run was ended because its worker gave no sign of life."
"""No fault of the run's: whoever asks for it again may get its answer."""
_STDIN, _STDOUT = 0, 1
_FIRST_TO_GO = b"500"
"""oom_score_adj: where memory runs out the kernel ends this child before the worker, the server or anybody else."""
_NO_SPACE = os.strerror(errno.ENOSPC)
_NO_MEMORY = re.compile(r"MemoryError|bad_alloc|Cannot allocate memory|out of memory|GL_OUT_OF_MEMORY", re.IGNORECASE)
_CHUNK = 1 << 16
_TAIL = 4096


def main() -> None:
    """Read the order, run the child, relay what it says, and end it when it must end."""
    # Ctrl-C in a terminal reaches the whole group of processes: the parent decides, and closes our input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    order = _read_order()
    end_with_parent(order["parent"])
    with tempfile.TemporaryFile() as errors:
        command = [sys.executable, "-m", order["module"]]
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors)
        _bound_memory(child.pid, order.get("memory_mb"))
        watch = _Watch(child, order)
        try:
            sentence = watch.until_end()
        finally:
            child.kill()
            child.wait()
        if sentence is None and not watch.answered:
            sentence = _why_ended(child.returncode, _last_line(errors), order.get("memory_mb"))
    if sentence is not None:
        _up(json.dumps({"error": sentence, "gone": sentence == NO_LEASE}).encode() + b"\n")


class _Watch:
    """The child's lines and its time."""

    def __init__(self, child: subprocess.Popen[bytes], order: dict[str, Any]) -> None:
        assert child.stdin is not None
        assert child.stdout is not None
        self.answered = False
        self._child = child
        self._timeout_s, self._lease_s = float(order["timeout_s"]), float(order["lease_s"])
        self._left_s, self._working = self._timeout_s, True
        self._alive_until = time.monotonic() + self._lease_s
        self._pending = b""
        child.stdin.write(json.dumps({"parent": os.getpid(), "task": order["task"]}).encode() + b"\n")
        child.stdin.close()

    def until_end(self) -> str | None:
        """Relay until the child closes its output (None), or must be ended (the reason)."""
        assert self._child.stdout is not None
        output = self._child.stdout.fileno()
        with selectors.DefaultSelector() as selector:
            for source in (_STDIN, output):
                selector.register(source, selectors.EVENT_READ)
            while True:
                begun = time.monotonic()
                ready = [key.fd for key, _ in selector.select(self._patience(begun))]
                now = time.monotonic()
                self._left_s -= (now - begun) * self._working
                if output in ready and not self._relay(os.read(output, _CHUNK)):
                    self._child.wait()
                    return None
                if _STDIN in ready and os.read(_STDIN, _CHUNK):
                    self._alive_until = now + self._lease_s
                elif _STDIN in ready or now >= self._alive_until:
                    return NO_LEASE
                if self._left_s <= 0:
                    return f"The run was ended after {self._timeout_s:g} s, its time limit."

    def _patience(self, now: float) -> float:
        until_lease = self._alive_until - now
        return max(0.0, min(until_lease, self._left_s) if self._working else until_lease)

    def _relay(self, data: bytes) -> bool:
        *lines, self._pending = (self._pending + data).split(b"\n")
        for line in lines:
            self._listen(line)
            _up(line + b"\n")
        return bool(data)

    def _listen(self, line: bytes) -> None:
        if line.startswith(b'{"phase"'):
            self._working = json.loads(line)["phase"] != "waiting"
        elif line.startswith((b'{"answer"', b'{"error"')):
            self.answered = True


def _bound_memory(pid: int, memory_mb: int | None) -> None:
    """Limit a child that waits for its task, and make it the first that the kernel ends for want of memory."""
    if memory_mb is not None:
        resource.prlimit(pid, resource.RLIMIT_DATA, (memory_mb << 20, memory_mb << 20))
    with suppress(OSError), open(f"/proc/{pid}/oom_score_adj", "wb") as file:
        file.write(_FIRST_TO_GO)


def _why_ended(code: int, last: str, memory_mb: int | None) -> str:
    """Why a child ended that gave no answer."""
    if memory_mb is not None and (code < 0 or _NO_MEMORY.search(last)):
        limit = f"the {memory_mb} MB that it may take (RAYFARM_SLICE_MEMORY_MB)"
        return f"The run ended for want of memory beyond {limit}: take a smaller scene or size, or raise the limit."
    if code == -signal.SIGKILL or _NO_MEMORY.search(last):
        return "The run was killed, most likely because this machine has no memory left: take a smaller scene or size."
    if _NO_SPACE in last:
        return "The run ended because the disk of this machine is full: free space, then measure again."
    return f"The run ended with code {code}: {last}"


def _read_order() -> dict[str, Any]:
    data = b""
    while b"\n" not in data:
        part = os.read(_STDIN, _CHUNK)
        if not part:
            raise SystemExit(0)
        data += part
    order: dict[str, Any] = json.loads(data.partition(b"\n")[0])
    return order


def _up(data: bytes) -> None:
    while data:
        data = data[os.write(_STDOUT, data) :]


def _last_line(errors: IO[bytes]) -> str:
    size = errors.seek(0, os.SEEK_END)
    errors.seek(max(0, size - _TAIL))
    lines = errors.read().decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "nothing on standard error"


if __name__ == "__main__":
    main()
