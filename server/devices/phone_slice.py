"""One slice on a phone, in a process of its own (`python -m server.devices.phone_slice`).

The task is `{"request", "round", "serial", "via", "deadline_s", "pictures"}`; `renderer.answering` says how it goes in
and the measurement comes out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from renderer.answering import Say, answer_task, silent, tell_note
from renderer.child import ChildError, run_child
from renderer.host import DeviceGoneError
from renderer.request import Request
from renderer.slice import Measurement, measure, pictures_of
from server.devices.agent_host import DEADLINE_S, AgentHost


def run_phone_slice(
    serial: str,
    via: str,
    request: Request,
    round_index: int,
    timeout_s: float = 900.0,
    *,
    pictures: Path | None = None,
    note: Say = silent,
) -> Measurement:
    """Run one slice on a phone in a fresh child process; raise ChildError with the reason, a phone gone being one."""
    task = {"request": request.to_json(), "round": round_index, "serial": serial, "via": via, "deadline_s": DEADLINE_S}
    task |= {"pictures": None if pictures is None else str(pictures)}
    try:
        return run_child("server.devices.phone_slice", task, request.threads, timeout_s, note=note)
    except DeviceGoneError as error:
        raise ChildError(str(error)) from error


def _work(task: dict[str, Any], say: Say) -> Measurement:
    host = AgentHost(task["serial"], task["via"], task["deadline_s"])
    request = Request.from_json(task["request"])
    return measure(request, task["round"], host, say, pictures_of(task), fresh=True, note=tell_note)


if __name__ == "__main__":
    answer_task(_work)
