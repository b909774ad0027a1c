"""`rayfarm import-profile FILE`: a profiler's CSV file for a measured job."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from server.cli.common import Client, ClientError, JsonFlag, ServerOption, make_console, print_json

Json = dict[str, Any]

MOST = 20
"""How many metrics are printed; --json prints all."""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("import-profile")(import_profile)


def import_profile(
    file: Annotated[Path, typer.Argument(help="The CSV file, as the profiler exported it.", show_default=False)],
    job: Annotated[int, typer.Option(help="The job that ran meanwhile.", show_default=False)],
    form: Annotated[
        str,
        typer.Option("--format", help="auto, snapdragon-realtime, snapdragon-draws, perfetto, agi-gapit or mapped."),
    ] = "auto",
    pairs: Annotated[
        list[str] | None,
        typer.Option("--map", help="METRIC=COLUMN for any other CSV; @time, @metric, @value, @unit name columns too."),
    ] = None,
    server: ServerOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Import a profiler's CSV file for a job, and show its metrics."""
    if not file.is_file():
        raise ClientError(f"There is no file {file}.")
    params = [("name", file.name), ("format", form), *(("map", pair) for pair in pairs or ())]
    with Client(server) as client:
        client.get(f"jobs/{job}")  # A refusal is better read before a long file is sent than while it is.
        view = client.upload(f"jobs/{job}/profiles", params, file)
        if as_json:
            print_json(view)
            return
        _print_profile(view)
        typer.echo(f"See it at {client.address}/jobs/{job}")


def _print_profile(view: Json) -> None:
    console = make_console()
    title = f"Profile {view['id']} of job {view['job']}: {view['format']}, {view['rows']:,} rows"
    table = Table(title=title, title_justify="left")
    table.add_column("metric", style="bold")
    for name in ("unit", "values", "mean", "median", "min", "max"):
        table.add_column(name, justify="left" if name == "unit" else "right")
    for metric in view["metrics"][:MOST]:
        figures = [f"{metric[name]:,.6g}" for name in ("mean", "median", "min", "max")]
        table.add_row(Text(_name(metric)), Text(metric["unit"] or ""), f"{metric['count']:,}", *figures)
    console.print(table)
    if len(view["metrics"]) > MOST:
        console.print(f"... and {len(view['metrics']) - MOST} more: --json prints all.")


def _name(metric: Json) -> str:
    instance = f"[{metric['instance']}]" if metric["instance"] else ""
    return f"{metric['name']}{instance}" + (f" ({metric['source']})" if metric["source"] else "")
