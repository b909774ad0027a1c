"""`rayfarm study NAME`: a named study, here or on a service."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from server.cli.alarms import SAME, show_alarms
from server.cli.common import SOME_FAILED, Client, ClientError, JsonFlag, make_console
from server.cli.follow import follow_study
from server.cli.submit import show_study
from server.cli.table import print_comparison

if TYPE_CHECKING:
    from renderer.child import ChildError
    from renderer.request import Request
    from server.studies import Planned

Json = dict[str, Any]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(study)


def study(
    name: Annotated[str, typer.Argument(help="A named study, as demo.")],
    size: Annotated[str | None, typer.Option(help="W or WxH, in pixels.")] = None,
    frames: Annotated[int | None, typer.Option(help="Timed frames over all rounds.")] = None,
    rounds: Annotated[int | None, typer.Option(help="Rounds, each in fresh processes.")] = None,
    repeats: Annotated[
        int | None, typer.Option(help="How often each request is measured; aa compares them by twos.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="With --server: the devices, as `rayfarm devices` lists.")] = None,
    output: Annotated[Path | None, typer.Option(help="Write the results there, one JSON document a line.")] = None,
    server: Annotated[str | None, typer.Option(help="Run it on a service instead of here.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Run a named study here, or with --server on a service, and compare its results."""
    if server is not None:
        if output is not None:
            raise ClientError("--output is for studies that run here: leave it out with --server.")
        given = {"size": size, "frames": frames, "rounds": rounds, "repeats": repeats, "devices": device}
        body = {"name": name} | {key: value for key, value in given.items() if value is not None}
        with Client(server) as client:
            posted = client.submit("studies", body)
            if name == SAME:
                raise typer.Exit(_watch_alarms(client, posted["id"], as_json))
            raise typer.Exit(show_study(client, posted, as_json))
    if device is not None:
        raise ClientError("--device is for studies on a service: add --server.")
    planned = _plan_here(name, size, frames=frames, rounds=rounds, repeats=repeats)
    results = _run_here(planned, Console(stderr=True))
    documents = [result for result in results if isinstance(result, dict)]
    if output is not None:
        output.write_text("".join(json.dumps(document) + "\n" for document in documents), encoding="utf-8")
    if name == SAME:
        show_alarms(documents, as_json)
    else:
        _report(documents, as_json)
    _tell_failures(planned, results)


def _watch_alarms(client: Client, number: int, as_json: bool) -> int:
    study = follow_study(client, number, Console(stderr=True, quiet=as_json))
    done = study["jobs_by_state"]["done"]
    show_alarms(client.get("results", [("of", f"study:{number}")])["results"] if done else [], as_json)
    return SOME_FAILED if study["jobs_by_state"]["failed"] else 0


def _plan_here(name: str, size: str | None, **changes: int | None) -> Planned:
    from renderer.request import parse_size
    from server.scene_list import is_here, require_scene
    from server.studies import plan_study, require_study, with_changes

    pixels = parse_size(size) if size else None
    return plan_study(with_changes(require_study(name), size=pixels, **changes), require_scene, is_here)


def _run_here(planned: Planned, console: Console) -> list[Json | ChildError]:
    from renderer.bench import run_jobs

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("slices"))
    with Progress(*columns, TimeElapsedColumn(), console=console) as progress:
        task = progress.add_task("", total=sum(request.rounds for request in planned.requests))

        def show(request: Request, round_index: int) -> None:
            text = f"{request.scene}, {request.variant.label}, round {round_index + 1}"
            progress.update(task, description=text, advance=1)

        return run_jobs(planned.requests, show)


def _report(documents: list[Json], as_json: bool) -> None:
    """Print the comparison; as JSON the documents, one a line."""
    if as_json:
        for document in documents:
            print(json.dumps(document))
        return
    from server.api.compare import comparison_view
    from server.comparison.flat import Stored
    from server.comparison.pivot import compare
    from server.comparison.selection import Selection
    from server.store.models import now

    stored = [Stored(index + 1, None, now().isoformat(), document) for index, document in enumerate(documents)]
    print_comparison(comparison_view(compare(stored[::-1], Selection().metric), Selection()), make_console())


def _tell_failures(planned: Planned, results: list[Json | ChildError]) -> None:
    failed = [(r, e) for r, e in zip(planned.requests, results, strict=True) if not isinstance(e, dict)]
    for request, error in failed:
        typer.echo(f"{request.scene}, {request.variant.label}: {error}", err=True)
    if failed:
        raise typer.Exit(SOME_FAILED)
