"""`rayfarm serve` and `rayfarm worker`."""

from __future__ import annotations

import gc
import signal
from typing import Annotated

import typer

from renderer.process import end_with_parent
from server.cli.common import JsonFlag, ParentOption, print_json

LOOK_S = 0.5
GIVEN_UP = 75
"""The exit code of a worker that was taken for dead and must be started anew (EX_TEMPFAIL)."""


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command()(serve)
    app.command()(worker)


def serve(
    host: Annotated[str | None, typer.Option(help="The address to listen at (RAYFARM_HOST).")] = None,
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="0 takes a free port (RAYFARM_PORT).")] = None,
    with_worker: Annotated[bool, typer.Option("--worker/--no-worker", help="Measure on this host too.")] = True,
    as_json: JsonFlag = False,
) -> None:
    """Serve the API and the pages, with a worker beside them, until told to end."""
    from server import logs
    from server.processes import signalled
    from server.service import address, listen, running
    from server.settings import settings

    chosen = settings()
    logs.start(chosen.log_level, chosen.log)
    sock = listen(chosen.host if host is None else host, chosen.port if port is None else port)
    with running(chosen, sock, with_worker):
        # All that is there by now stays: each full collection would stop every request to walk through it.
        gc.collect()
        gc.freeze()
        if as_json:
            print_json({"address": address(sock)})
        else:
            typer.echo(f"RayFarm serves at {address(sock)}")
        signalled().wait()


def worker(
    until_idle: Annotated[bool, typer.Option("--until-idle", help="End when the queue is empty.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Log warnings only.")] = False,
    parent: ParentOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure what is queued, one slice at a time on each of this machine's devices, until told to end."""
    from server import logs
    from server.processes import signalled
    from server.settings import settings
    from server.working import working

    chosen = settings()
    logs.start("warning" if quiet else chosen.log_level, chosen.log)
    if parent is not None:
        end_with_parent(parent, signal.SIGTERM)
    told = signalled()
    with working(chosen) as measuring:
        if as_json:
            print_json({"worker": measuring.name})
        while not told.wait(LOOK_S) and not measuring.given_up:
            if until_idle and measuring.is_idle():
                return
        given_up = measuring.given_up  # Once it was stopped it says so of itself, too.
    if given_up:
        raise typer.Exit(GIVEN_UP)
