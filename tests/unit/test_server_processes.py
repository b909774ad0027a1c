"""A process that is told to end learns of it, whatever its main thread was doing."""

from __future__ import annotations

import subprocess
import sys

ASKING = """
import os, signal, threading
from server.processes import signalled

for number in range(30):
    told = signalled()
    # Between any two steps of what asks, mostly.
    threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGTERM)).start()
    while not told.wait(0.0):
        pass
    assert told.wait()
"""

WAITING = """
import os, signal, threading
from server.processes import signalled

told = signalled()
assert not told.wait(0.01)
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
assert told.wait()
"""


def run(script: str) -> None:
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_a_signal_is_heard_by_who_asks_all_the_time() -> None:
    run(ASKING)


def test_a_signal_ends_an_endless_wait() -> None:
    run(WAITING)
