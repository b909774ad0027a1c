"""A slice that only takes time, in a leashed child (`python -m chaos_slice`): notes when it held its device.

It takes no lock: what keeps two of them from one device at a time is the queue alone.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from renderer.answering import Say, answer_task


def work(task: dict[str, Any], say: Say) -> dict[str, Any]:
    log = Path(task["log"])
    holder = log.with_name(f"holder-{task['device']}")
    before = holder.read_text() if holder.exists() else ""
    if before and _is_alive(before):
        _note(log, f"violation {task['device']} {before}")
    holder.write_text(str(os.getpid()))
    say("running")
    _note(log, f"start {task['job']} {task['device']} {os.getpid()}")
    time.sleep(task["seconds"])
    _note(log, f"end {task['job']} {task['device']} {os.getpid()}")
    holder.write_text("")
    return {"round": 0, "speed": 1.0}


def _is_alive(pid: str) -> bool:
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return b"chaos_slice" in command


def _note(log: Path, line: str) -> None:
    with log.open("a") as out:
        out.write(f"{line}\n")


if __name__ == "__main__":
    answer_task(work)
