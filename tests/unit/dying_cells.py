"""A study's process that dies at the family `limits`: it waits where a second is the limit, else it ends itself."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from renderer.answering import answer_task
from renderer.hard_cases import child
from renderer.hard_cases.cell import Cell

limit_s = 0.0


def measure(_asker: object, variant: Any, ready: Any, **_options: object) -> Cell:
    if ready.family.name == "limits":
        if limit_s > 1.0:
            os.kill(os.getpid(), signal.SIGSEGV)
        time.sleep(60.0)
    return Cell(variant, ready.family.name, 0)


def work(task: dict[str, Any], say: Any) -> dict[str, Any]:
    global limit_s
    limit_s = task["limit_s"]
    return child.fill_cells(task | {"share": 0.01}, say)


if __name__ == "__main__":
    stand_ins = {
        "measure_cell": measure,
        "Asker": lambda _: None,
        "open_context": lambda: None,
        "describe": lambda *_: {},
    }
    for name, stand_in in stand_ins.items():
        setattr(child, name, stand_in)
    answer_task(work)
