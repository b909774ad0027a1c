"""`rayfarm scenes`: the catalogue, and fetching from it."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from server.cli.common import JsonFlag, make_console, print_json

verbs = typer.Typer(help="List the scenes, or fetch one.", invoke_without_command=True, rich_markup_mode=None)


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.add_typer(verbs, name="scenes")


@verbs.callback()
def show(context: typer.Context, as_json: JsonFlag = False) -> None:
    """List the scenes with triangle count, licence and whether they are here."""
    if context.invoked_subcommand is None:
        _show_list(as_json)


@verbs.command("list")
def show_list(as_json: JsonFlag = False) -> None:
    """List the scenes."""
    _show_list(as_json)


@verbs.command()
def fetch(
    name: Annotated[str, typer.Argument(help="A scene of the catalogue.")],
    as_json: JsonFlag = False,
) -> None:
    """Download a scene from its public address and check it."""
    from scenes.fetch import fetch as fetch_scene

    said: list[str] = []
    path = fetch_scene(name, tell=said.append if as_json else typer.echo)
    if as_json:
        print_json({"scene": name, "path": str(path), "checked": said})


def _show_list(as_json: bool) -> None:
    from scenes.catalogue import list_scenes

    scenes = list_scenes()
    if as_json:
        print_json(scenes)
        return
    table = Table(box=None, pad_edge=False)
    for head in ("scene", "triangles", "here", "licence", "note"):
        table.add_column(head, justify="right" if head == "triangles" else "left", no_wrap=head == "scene")
    for entry in scenes:
        table.add_row(*_line(entry))
    make_console().print(table)


def _line(entry: dict[str, Any]) -> list[Text]:
    here = "yes" if entry["here"] else entry["get"]
    texts = (entry["name"], f"{entry['triangles']:,}", here, entry["licence"], entry["note"])
    return [Text(text) for text in texts]
