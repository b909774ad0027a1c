"""Work for a leashed child, told by its task (`python -m leashed_work`)."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from renderer.answering import Say, answer_task
from renderer.host import DeviceGoneError
from renderer.request import RequestError


def work(task: dict[str, Any], say: Say) -> dict[str, Any]:
    Path(task["pid"]).write_text(str(os.getpid()))
    for phase, seconds in task.get("phases", []):
        say(phase)
        time.sleep(seconds)
    match task.get("end"):
        case "spoken":
            raise RequestError("The size is 0: give more.")
        case "gone":
            raise DeviceGoneError("The phone went away.")
        case "unexpected":
            raise KeyError("t")
        case "killed":
            os.kill(os.getpid(), 9)
        case "noise":
            print("Vulkan: loaded 3 layers")
            print('{"unknown": 1}')
    return {"said": task.get("answer")}


if __name__ == "__main__":
    answer_task(work)
