"""`rayfarm up`: the whole house at once, as `make run` calls it."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Annotated

import typer

from server.cli.common import Client, JsonFlag
from server.cli.submit import show_study


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(up)


def up(
    leave: Annotated[bool, typer.Option("--exit", help="End after the table instead of serving on.")] = False,
    study: Annotated[str, typer.Option(help="The study to submit.")] = "demo",
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="0 takes a free port (RAYFARM_PORT).")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Start the service, submit the demo study over HTTP, show its table, and keep serving."""
    from server import logs
    from server.processes import signalled
    from server.service import address, listen, running
    from server.settings import settings

    chosen = settings()
    logs.start("warning", chosen.log)
    sock = listen(chosen.host, chosen.port if port is None else port)
    base = address(sock)
    signal.signal(signal.SIGTERM, _exit)
    with running(chosen, sock, with_worker=True, quiet=True), Client(base) as client:
        if not as_json:
            typer.echo(f"RayFarm serves at {base}")
        code = show_study(client, client.submit("studies", {"name": study}), as_json)
        if not leave:
            typer.echo("Serving on: end it with Ctrl-C.", err=as_json)
            signalled().wait()
    raise typer.Exit(code)


def _exit(_number: int, _frame: FrameType | None) -> None:
    raise SystemExit(0)
