"""A study that runs here: measured, kept in a journal as it goes on, and continued when it was interrupted."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from renderer.answering import Say
from renderer.bench import run_jobs, run_slice
from renderer.child import ChildError
from renderer.request import Request, parse_size
from server.cli.alarms import SAME, show_alarms
from server.cli.common import SOME_FAILED, ClientError, make_console
from server.cli.gate import print_differences
from server.cli.journal import Journal, Kept, open_journal
from server.cli.paper_report import print_verdicts, report_here
from server.cli.progress import Pace, slices_bar
from server.cli.reports import report_path
from server.cli.table import print_comparison
from server.comparison.differences import find_differences
from server.live.time_left import write_left
from server.named_studies import SPECIALISE, require_study
from server.scene_list import is_here, require_scene
from server.studies import Planned, plan_study, with_changes

Json = dict[str, Any]


def study_here(
    name: str, changes: Json, output: Path | None, report: Path | None, as_json: bool, *, fresh: bool
) -> int:
    """Measure a named study and print what came of it; the exit code, 1 when a job failed.

    What has ended stays in the journal until all has been measured, printed and written.
    """
    path = report_path(name, report)
    planned = _plan(name, changes)
    console = Console(stderr=True)
    if output is not None and not output.parent.is_dir():
        raise ClientError(f"The results cannot be written to {output}: there is no folder {output.parent}.")
    with open_journal(planned.requests) as journal:
        if fresh:
            journal.start_anew()
        try:
            results = measure(planned.requests, journal, console, None if path is None else journal.pictures)
        except KeyboardInterrupt:
            console.print("Interrupted: the same command goes on from here.")
            raise
        documents = [result for result in results if isinstance(result, dict)]
        if output is not None:
            output.write_text("".join(json.dumps(document) + "\n" for document in documents), encoding="utf-8")
        if path is None or as_json:
            _show(name, documents, as_json)
        if path is not None and documents:
            written = report_here(documents, journal.pictures, path)
            if not as_json:
                print_verdicts(written.verdicts, make_console())
            console.print(written.text, markup=False, highlight=False, soft_wrap=True)
        failed = _tell_failures(planned, results)
        if not failed:
            journal.remove()
    return SOME_FAILED if failed else 0


def measure(
    requests: Sequence[Request], journal: Journal, console: Console, pictures: Path | None = None
) -> list[Json | ChildError]:
    """Measure what the journal does not have yet; each request's result, or the error that ended it.

    Pictures of what is measured go into the folder `pictures`.
    """
    total = sum(request.rounds for request in requests)
    if len(journal):
        console.print(f"{len(journal)} of {total} slices were measured before; --fresh starts anew.", highlight=False)
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
    pace = Pace(requests)
    with slices_bar(console) as progress:
        task = progress.add_task("", total=total, left="")

        named = ""

        def begin(request: Request, round_index: int) -> None:
            nonlocal named
            named = f"{request.scene}, {request.variant.label}, round {round_index + 1}"
            progress.update(task, description=named)

        def hear(text: str) -> None:
            progress.update(task, description=f"{named}, {text}")

        def advance(slices: int) -> None:
            progress.update(task, advance=slices, left=write_left(pace.seconds_left()) or "")

        def run(request: Request, round_index: int) -> Json:
            try:
                kept = journal.take(request, round_index) or _measured(journal, request, round_index, pictures, hear)
            except ChildError:
                advance(pace.failed(request, round_index))
                raise
            pace.ended(request, round_index, kept.seconds)
            advance(1)
            return kept.measurement

        return run_jobs(requests, begin, run)


def _measured(journal: Journal, request: Request, round_index: int, pictures: Path | None, note: Say) -> Kept:
    begun = time.monotonic()
    measurement = run_slice(request, round_index, pictures=pictures, note=note)
    kept = Kept(time.monotonic() - begun, measurement)
    journal.keep(request, round_index, kept)
    return kept


def _plan(name: str, changes: Json) -> Planned:
    pixels = {"size": parse_size(changes["size"])} if "size" in changes else {}
    return plan_study(with_changes(require_study(name), **{**changes, **pixels}), require_scene, is_here)


def _show(name: str, documents: Sequence[Json], as_json: bool) -> None:
    """Print the comparison, or of `aa` the alarms; as JSON the documents, one a line."""
    if name == SAME:
        show_alarms(list(documents), as_json)
        return
    if as_json:
        for document in documents:
            print(json.dumps(document))
        return
    if name == SPECIALISE:
        sides = [[one for one in documents if (one["specialised"] is None) == off] for off in (True, False)]
        print_differences(find_differences(sides[0], sides[1], ("specialise",)), make_console())
        return
    from server.api.compare import comparison_view
    from server.comparison.flat import Stored
    from server.comparison.pivot import compare
    from server.comparison.selection import Selection
    from server.store.models import now

    stored = [Stored(index + 1, None, now().isoformat(), document) for index, document in enumerate(documents)]
    print_comparison(comparison_view(compare(stored[::-1], Selection().metric), Selection()), make_console())


def _tell_failures(planned: Planned, results: Sequence[Json | ChildError]) -> bool:
    """Print why jobs have no result; whether there are any."""
    failed = [(r, e) for r, e in zip(planned.requests, results, strict=True) if not isinstance(e, dict)]
    for request, error in failed:
        typer.echo(f"{request.scene}, {request.variant.label}: {error}", err=True)
    if failed:
        typer.echo("The same command tries these anew and keeps the others' measurements.", err=True)
    return bool(failed)
