"""`rayfarm serve` and `rayfarm worker`."""

from __future__ import annotations

import logging
from typing import Annotated

import typer

from renderer.host import end_with_parent
from server.cli_common import JsonFlag, ParentOption, print_json
from server.settings import settings


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
    from server.service import address, listen, running, wait_for_end

    chosen = settings()
    sock = listen(chosen.host if host is None else host, chosen.port if port is None else port)
    with running(chosen, sock, with_worker):
        if as_json:
            print_json({"address": address(sock)})
        else:
            typer.echo(f"RayFarm serves at {address(sock)}")
        wait_for_end()


def worker(
    until_idle: Annotated[bool, typer.Option("--until-idle", help="End when the queue is empty.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Log warnings only.")] = False,
    parent: ParentOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Measure what is queued, one slice at a time, until told to end."""
    import signal

    from renderer.bench import combine, run_slice
    from server.store.database import Database
    from server.worker import Stopped, Worker, stop_on_signals

    stop_on_signals()
    if parent is not None:
        end_with_parent(parent, signal.SIGTERM)
    logging.basicConfig(level=logging.WARNING if quiet else logging.INFO, format="%(message)s")
    logging.getLogger("alembic").setLevel(logging.WARNING)
    chosen = settings()
    database = Database(chosen.database_url)
    measuring = Worker(database, run_slice, combine, timeout_s=chosen.slice_timeout_s, lease_s=chosen.lease_s)
    if as_json:
        print_json({"worker": measuring.name})
    try:
        measuring.run_until_idle() if until_idle else measuring.run()
    except Stopped:
        return
    finally:
        database.close()
