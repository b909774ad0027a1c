"""Following a study until it ends."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from server.cli_common import Client
from server.store.states import OPEN

PERIOD_S = 0.5

Json = dict[str, Any]


def follow_study(client: Client, number: int, console: Console) -> Json:
    """Show a study's progress on `console` until it has ended; the study as the API gives it."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("slices"))
    told: set[int] = set()
    with Progress(*columns, TimeElapsedColumn(), console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(f"study {number}")
        while True:
            study: Json = client.get(f"studies/{number}")
            slices = study["slices"]
            progress.update(task, completed=slices["done"] + slices["ended"], total=slices["total"])
            _tell_ended(study, told, progress.console)
            if study["state"] not in OPEN:
                return study
            time.sleep(PERIOD_S)


def _tell_ended(study: Json, told: set[int], console: Console) -> None:
    """A line for every job that ended since the last time."""
    for job in study["jobs"]:
        if job["state"] in OPEN or job["id"] in told:
            continue
        told.add(job["id"])
        line = f"[{len(told)}/{len(study['jobs'])}] {job['scene']}, {job['variant']}: {job['state']}"
        console.print(Text(line + (f": {job['reason']}" if job["reason"] else "")))
