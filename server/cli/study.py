"""`rayfarm study NAME`: a named study, here or on a service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from server.cli.alarms import SAME, show_alarms
from server.cli.common import SOME_FAILED, Client, ClientError, JsonFlag, make_console
from server.cli.follow import follow_study
from server.cli.paper_report import print_verdicts, report_there
from server.cli.reports import REPORTS, report_path
from server.cli.submit import show_study

Json = dict[str, Any]
HARD_CASES = "hard-cases"
HARD_CASES_HERE = (
    "The study hard-cases runs here and has families for scenes: give it --traversal, --output, --report, --server and "
    "--json alone."
)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(study)


def study(
    name: Annotated[
        str | None, typer.Argument(help="A named study: demo, paper, specialise, aa or hard-cases.", show_default=False)
    ] = None,
    size: Annotated[str | None, typer.Option(help="W or WxH, in pixels.")] = None,
    frames: Annotated[int | None, typer.Option(help="Timed frames over all rounds.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Rounds, each in fresh processes.")] = None,
    repeats: Annotated[
        int | None, typer.Option(help="How often each request is measured; aa compares them by twos.")
    ] = None,
    models: Annotated[
        bool | None, typer.Option("--models/--no-models", help="Run the memory and the ALU model, or do not.")
    ] = None,
    traversal: Annotated[
        str | None,
        typer.Option(help="With hard-cases: a comma list of traversals, all by default.", show_default=False),
    ] = None,
    device: Annotated[str | None, typer.Option(help="With --server: the devices, as `rayfarm devices` lists.")] = None,
    output: Annotated[Path | None, typer.Option(help="Write the results there, one JSON document a line.")] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            help=f"With {' and '.join(REPORTS)}: where the report goes, by default {REPORTS['paper']} and so on.",
            show_default=False,
        ),
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has measured here.")] = False,
    follow: Annotated[
        int | None, typer.Option(help="With --server: go on watching the study of this number.", show_default=False)
    ] = None,
    server: Annotated[
        str | None, typer.Option(help="Run it on a service instead of here; hard-cases runs here and is handed to it.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Run a named study here, or with --server on a service, and compare its results.

    A study that was interrupted here goes on where it was when the same command is given again.
    """
    given = {"size": size, "frames": frames, "rounds": rounds, "repeats": repeats, "models": models, "devices": device}
    changes = {key: value for key, value in given.items() if value is not None}
    if name == HARD_CASES:
        from server.cli.hard_cases import hard_cases_here

        others = (*changes.values(), follow, fresh or None)
        _refuse(next((value for value in others if value is not None), None), HARD_CASES_HERE)
        raise typer.Exit(hard_cases_here(traversal, output, report, as_json, server))
    _refuse(traversal, "--traversal is for the study hard-cases: leave it out.")
    if server is None and follow is None:
        _refuse(device, "--device is for studies on a service: add --server.")
        _refuse(name is None or None, "Name a study: demo, paper, specialise, aa or hard-cases.")
        from server.cli.study_here import study_here

        raise typer.Exit(study_here(str(name), changes, output, report, as_json, fresh=fresh))
    _refuse(output, "--output is for studies that run here: leave it out with --server.")
    _refuse(fresh or None, "--fresh is for studies that run here: leave it out with --server.")
    with Client(server) as client:
        posted = (
            _submitted(client, name, changes, report) if follow is None else _to_follow(client, follow, name, changes)
        )
        raise typer.Exit(_watch(client, posted, report, as_json))


def _refuse(value: object, sentence: str) -> None:
    if value is not None:
        raise ClientError(sentence)


def _submitted(client: Client, name: str | None, changes: Json, report: Path | None) -> Json:
    if name is None:
        raise ClientError(
            "Name a study: demo, paper, specialise, aa or hard-cases; or give --follow ID to go on watching one."
        )
    report_path(name, report)
    posted: Json = client.submit("studies", {"name": name, **changes})
    return posted


def _to_follow(client: Client, number: int, name: str | None, changes: Json) -> Json:
    if name is not None or changes:
        raise ClientError("A study that is followed has been submitted: give --follow ID without a name and a size.")
    posted: Json = client.get(f"studies/{number}")
    return posted


def _watch(client: Client, posted: Json, report: Path | None, as_json: bool) -> int:
    """Follow a study to its end and show what came of it; the exit code, 1 when a job failed."""
    number, path = posted["id"], report_path(posted["name"], report)
    notes = Console(stderr=True, quiet=as_json, highlight=False, soft_wrap=True)
    notes.print(f"Watch it again with: rayfarm study --server {client.address} --follow {number}", markup=False)
    if posted["name"] == SAME:
        return _watch_alarms(client, number, as_json)
    code = show_study(client, posted, as_json)
    if path is not None:
        written = report_there(client, number, path)
        if not as_json:
            print_verdicts(written.verdicts, make_console())
        notes.print(written.text, markup=False)
    return code


def _watch_alarms(client: Client, number: int, as_json: bool) -> int:
    study = follow_study(client, number, Console(stderr=True, quiet=as_json))
    done = study["jobs_by_state"]["done"]
    show_alarms(client.get("results", [("of", f"study:{number}")])["results"] if done else [], as_json)
    return SOME_FAILED if study["jobs_by_state"]["failed"] else 0
