"""`rayfarm tokens`: making, listing and revoking the tokens of a service, on its database."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from server.cli.common import JsonFlag, make_console, print_json

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

    from server.store.models import Token

verbs = typer.Typer(help="Make, list and revoke API tokens.", no_args_is_help=True, rich_markup_mode=None)


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.add_typer(verbs, name="tokens")


@verbs.command()
def create(
    name: Annotated[str, typer.Argument(help="Whose it is, or what it is for.")],
    scope: Annotated[str, typer.Option(help="submit, read, worker, admin; several with commas.")] = "submit",
    days: Annotated[int, typer.Option(min=1, max=3650, help="How long it is good.")] = 90,
    as_json: JsonFlag = False,
) -> None:
    """Make a token and print it, this once: only its hash is kept."""
    from server.access import tokens

    scopes = [word.strip() for word in scope.split(",") if word.strip()]
    with _writing() as session:
        token, text = tokens.create(session, name, scopes, timedelta(days=days))
        view = _view(token)
    print_json(view | {"token": text}) if as_json else typer.echo(text)


@verbs.command("list")
def list_all(as_json: JsonFlag = False) -> None:
    """List the tokens without their secrets."""
    from server.access import tokens

    with _writing() as session:
        views = [_view(token) for token in tokens.list_tokens(session)]
    if as_json:
        print_json({"tokens": views})
        return
    table = Table(box=None, pad_edge=False)
    for head in ("id", "name", "scopes", "expires", "state"):
        table.add_column(head)
    for view in views:
        cells = (view["id"], view["name"], ", ".join(view["scopes"]), view["expires_at"], view["state"])
        table.add_row(*(Text(cell) for cell in cells))
    make_console().print(table if views else "No token yet: make one with `rayfarm tokens create NAME`.")


@verbs.command()
def revoke(
    token_id: Annotated[str, typer.Argument(metavar="ID", help="As `rayfarm tokens list` shows it.")],
    as_json: JsonFlag = False,
) -> None:
    """Revoke a token, and log out the pages that were opened with it, at once."""
    from server.access import tokens

    with _writing() as session:
        view = _view(tokens.revoke(session, token_id))
    print_json(view) if as_json else typer.echo(f"{view['id']} ({view['name']}) is revoked.")


@contextmanager
def _writing() -> Iterator[Session]:
    from server.settings import settings
    from server.store.database import Database

    database = Database(settings().database_url)
    try:
        with database.writing() as session:
            yield session
    finally:
        database.close()


def _view(token: Token) -> dict[str, Any]:
    from server.access import tokens

    return {
        "id": token.id,
        "name": token.name,
        "scopes": token.scopes,
        "created_at": token.created_at.isoformat(timespec="seconds"),
        "expires_at": token.expires_at.isoformat(timespec="seconds"),
        "state": tokens.state_of(token),
    }
