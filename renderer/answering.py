"""Work in a fresh child process: the child's end of it; `renderer.child` is the parent's.

The task comes down as one line of JSON on standard input. Up go lines of JSON on standard output: `{"phase": P}` as
the work goes on, `{"note": TEXT}` for who watches it, and last `{"answer": A}`, or
`{"error": SENTENCE, "gone": whether the device went away}`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

from renderer.build.errors import BuildError
from renderer.host import DeviceGoneError
from renderer.pack.nodes import PackError
from renderer.phone_compile.errors import CompileError
from renderer.plan import PlanError
from renderer.process import end_with_parent
from renderer.request import RequestError
from scenes.scene import SceneError

Json = dict[str, Any]
Say = Callable[[str], None]
"""Told each phase of the work."""

SPOKEN = (SceneError, BuildError, PackError, PlanError, RequestError, CompileError)
"""Errors whose message is a sentence for the user."""


def silent(_phase: str) -> None:
    """Say nothing."""


def tell_note(text: str) -> None:
    """In a child: tell the parent what is done just now, in words for a user."""
    _print({"note": text})


def answer_task(work: Callable[[Json, Say], Json]) -> None:
    """The child's end: read one task, work on it, print the answer or the spoken error."""
    order = json.loads(sys.stdin.readline())
    end_with_parent(order["parent"])
    last: Json
    try:
        last = {"answer": work(order["task"], lambda phase: _print({"phase": phase}))}
    except SPOKEN as error:
        last = {"error": str(error), "gone": False}
    except DeviceGoneError as error:
        last = {"error": str(error), "gone": True}
    _print(last)


def _print(message: Json) -> None:
    print(json.dumps(message), flush=True)
