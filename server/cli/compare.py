"""`rayfarm compare`: a service's results in the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from renderer.variant import Variant
from server.cli.common import Client, ClientError, JsonFlag, ServerOption, make_console, print_json
from server.cli.table import print_comparison, print_fronts
from server.comparison.differences import DEFAULT_GATE

FRONTS = ("error", "size")


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(compare)


def compare(
    where: Annotated[
        list[str] | None, typer.Argument(help="Filters as AXIS=VALUE, also scene=, device=, study=.")
    ] = None,
    metric: Annotated[str | None, typer.Option(help="The figure to compare, mrays_per_s by default.")] = None,
    rows: Annotated[str | None, typer.Option(help="What stands on the rows, comma separated.")] = None,
    cols: Annotated[str | None, typer.Option(help="What stands on the columns.")] = None,
    sort: Annotated[str | None, typer.Option(help="A column, best first; with - before it, worst first.")] = None,
    ratio_to: Annotated[
        str | None, typer.Option(help=f"A row, as {Variant.traversal}, that all others get a ratio to.")
    ] = None,
    front: Annotated[str | None, typer.Option(help="Tell the Pareto front of speed against error or size.")] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print every result as a line of CSV.")] = False,
    form: Annotated[
        str | None,
        typer.Option("--format", help="Every result as csv, jsonl, parquet; or the table as markdown, latex."),
    ] = None,
    output: Annotated[Path | None, typer.Option(help="The file for --format; standard output without it.")] = None,
    baseline: Annotated[
        str | None, typer.Option(help="job:1, study:2, a file of results, or NAME=VALUE,...; needs --against.")
    ] = None,
    against: Annotated[str | None, typer.Option(help="What is held against --baseline, written alike.")] = None,
    gate: Annotated[
        bool, typer.Option("--gate", help="Exit with 1 when a pair's slowdown surely passes --threshold.")
    ] = False,
    threshold: Annotated[float, typer.Option(help="The gate's slowdown in per cent.")] = DEFAULT_GATE * 100,
    clock: Annotated[str, typer.Option(help="wall, cpu, or auto: cpu on llvmpipe, with --baseline.")] = "auto",
    server: ServerOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Show results side by side, or with --baseline and --against how two sets of them differ.

    The latter takes jobs and studies of a service, files of `bench --json` and `study --output`, and selections, as
    study:3,layout=normal; pairs share all that the two do not both name.
    """
    if baseline is not None or against is not None or gate:
        from server.cli.gate import compare_sides

        raise typer.Exit(compare_sides(baseline, against, threshold, gate, clock, server, as_json))
    if front is not None and front not in FRONTS:
        raise ClientError(f"Unknown front {front!r}: choose one of {', '.join(FRONTS)}.")
    named = {"metric": metric, "rows": rows, "cols": cols, "sort": sort, "baseline": ratio_to}
    params = [(name, value) for name, value in named.items() if value is not None]
    params += [_read_filter(text) for text in where or []]
    with Client(server) as client:
        if csv or form or output:
            from server.cli.export import export

            export(client.address, params, form or "csv", output)
            return
        view = client.get("compare", params)
        if as_json:
            print_json(view)
            return
        print_comparison(view, make_console())
        if front is not None:
            print_fronts(view, front, make_console())
        typer.echo(f"See it at {client.address}{view['page']}")


def _read_filter(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ClientError(f"The filter {text!r} is not understood: write it as scene=forest.")
    return name, value
