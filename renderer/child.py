"""Work in a fresh child process that holds the host's lock: both ends of it.

The task goes in as JSON on standard input, the answer comes out as JSON on the last line of standard output.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from renderer.build.api import BuildError
from renderer.host import end_with_parent, measuring
from renderer.pack.nodes import PackError
from renderer.plan import PlanError
from renderer.request import RequestError
from scenes.scene import SceneError

Json = dict[str, Any]

SPOKEN = (SceneError, BuildError, PackError, PlanError, RequestError)
"""Errors whose message is a sentence for the user."""


class ChildError(RuntimeError):
    """A child that gave no answer; the message is one sentence."""


def run_child(module: str, task: Json, threads: int, timeout_s: float) -> Json:
    """Run `python -m module` on a task with `threads` rasteriser threads and return its answer.

    The child ends with this process. Raise ChildError with its reason when it fails or works for longer than
    `timeout_s` seconds; waiting for other work on this host does not count.
    """
    done = subprocess.run(
        [sys.executable, "-m", module],
        input=json.dumps({"parent": os.getpid(), "timeout_s": timeout_s, "work": task}),
        capture_output=True,
        text=True,
        env=os.environ | {"LP_NUM_THREADS": str(threads), "PYTHONUNBUFFERED": "1"},
        check=False,
    )
    if done.returncode == -signal.SIGALRM:
        raise ChildError(f"The run was ended after {timeout_s:g} s, its time limit.")
    answer = _last_json(done.stdout)
    if done.returncode != 0 or answer is None:
        last = (done.stderr.strip().splitlines() or ["nothing on standard error"])[-1]
        raise ChildError(f"The run ended with code {done.returncode}: {last}")
    if set(answer) == {"error"}:
        raise ChildError(answer["error"])
    return answer


def answer_task(work: Callable[[Json], Json]) -> None:
    """The child's end: read one task, hold the host while working on it, print the answer or the spoken error."""
    task = json.load(sys.stdin)
    end_with_parent(task["parent"])
    try:
        with measuring():
            # Its default action ends the process, whatever a driver is doing.
            signal.setitimer(signal.ITIMER_REAL, task["timeout_s"])
            answer = work(task["work"])
    except SPOKEN as error:
        answer = {"error": str(error)}
    print(json.dumps(answer))


def _last_json(text: str) -> Json | None:
    lines = text.strip().splitlines()
    try:
        answer = json.loads(lines[-1]) if lines else None
    except ValueError:
        return None
    return answer if isinstance(answer, dict) else None
