"""The process that fills cells (`python -m renderer.hard_cases.child`), written down one by one as they are done.

It ends itself when a cell takes too long, even within a driver's call, so that a hang is a count and not a wait.
"""

from __future__ import annotations

import faulthandler
import json
import os
import random
import time
from pathlib import Path
from typing import Any, TextIO

from renderer.answering import Say, answer_task
from renderer.hard_cases.asking import Asker
from renderer.hard_cases.measure import measure_cell
from renderer.hard_cases.ready import Ready
from renderer.twin import open_context
from renderer.twin_host import describe
from renderer.variant import Variant
from scenes.hard_cases import FAMILIES

Json = dict[str, Any]


def fill_cells(task: Json, say: Say) -> Json:
    """Fill the task's cells, but for those that are done."""
    os.environ["RAYFARM_CACHE"] = task["folder"]
    folder, seed = Path(task["folder"]), task["seed"]
    cases = {name: Ready(FAMILIES[name], seed, task["share"], folder) for name in task["families"]}
    context = open_context()
    asker = Asker(context)
    with Path(task["journal"]).open("a", encoding="utf-8") as journal:
        _note(journal, {"device": describe(context, 1)})
        for variant in (Variant(**values) for values in task["variants"]):
            say("running")
            for name in _met(task, variant):
                _note(journal, {"begin": [variant.as_dict(), name], "at": time.time()})
                faulthandler.dump_traceback_later(task["limit_s"], exit=True)
                fitted = name in _sample(variant, task)
                cell = measure_cell(asker, variant, cases[name], fitted=fitted, timed=task["timed"])
                faulthandler.cancel_dump_traceback_later()
                _note(journal, {"cell": cell.to_json()})
    return {}


def _met(task: Json, variant: Variant) -> list[str]:
    """The families that a variant has still to meet."""
    done = task["done"]
    spawning = variant.offset != Variant().offset
    return [
        name
        for name in task["families"]
        if [variant.as_dict(), name] not in done and (FAMILIES[name].spawns or not spawning)
    ]


def _sample(variant: Variant, task: Json) -> list[str]:
    """The families whose specialised text is checked for a variant, by the seed."""
    return random.Random(f"{task['seed']} {variant.label}").sample(
        task["families"], min(task["fitted"], len(task["families"]))
    )


def _note(journal: TextIO, line: Json) -> None:
    journal.write(json.dumps(line) + "\n")
    journal.flush()


if __name__ == "__main__":
    answer_task(fill_cells)
