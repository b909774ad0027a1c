"""Following a study until it ends."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from server.cli.common import Client
from server.cli.events import follow_events
from server.cli.progress import slices_bar
from server.store.states import OPEN

Json = dict[str, Any]


def follow_study(client: Client, number: int, console: Console) -> Json:
    """Show a study's progress on `console` until it has ended; the study as the API gives it."""
    jobs: dict[int, Json] = {job["id"]: job for job in client.get(f"studies/{number}")["jobs"]}
    told = 0
    with slices_bar(console, hidden=not console.is_terminal) as progress:
        task = progress.add_task(f"study {number}", left="")
        for change in follow_events(client, f"studies/{number}/events"):
            slices = change["study_progress"]
            progress.update(task, completed=slices["done"] + slices["ended"], total=slices["total"])
            progress.update(task, left=change["study_left"] or "")
            if change["state"] not in OPEN:
                told += 1
                progress.console.print(_line(f"[{told}/{len(jobs)}]", jobs[change["job"]], change))
    study: Json = client.get(f"studies/{number}")
    return study


def _line(count: str, job: Json, change: Json) -> Text:
    """How a job ended."""
    line = f"{count} {job['scene']}, {job['variant']}: {change['state']}"
    return Text(line + (f": {change['reason']}" if change["reason"] else ""))
