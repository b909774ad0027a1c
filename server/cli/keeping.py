"""`rayfarm backup`, `restore` and `prune`, on the machine that has the store."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from server.cli.common import JsonFlag, print_json

if TYPE_CHECKING:
    from server.keeping.backup import Report

File = Annotated[Path, typer.Argument(help="The backup, one file.", show_default=False)]


def register(app: typer.Typer) -> None:
    """Add the verbs."""
    app.command()(backup)
    app.command()(restore)
    app.command()(prune)


def backup(file: File, as_json: JsonFlag = False) -> None:
    """Write the whole store, database and files, into one file; the farm may go on meanwhile."""
    from server.keeping.backup import back_up
    from server.settings import settings
    from server.store.blobs import Blobs

    chosen = settings()
    _tell("Backed up", back_up(chosen.database_url, Blobs(chosen.blobs), file), as_json)


def restore(
    file: File,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a store that is not empty.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Put a backup in place of an empty store; end servers and workers first."""
    from server.keeping import backup as backups
    from server.settings import settings
    from server.store.blobs import Blobs

    chosen = settings()
    report = backups.restore(chosen.database_url, Blobs(chosen.blobs), file, overwrite=overwrite)
    _tell("Restored", report, as_json)


def prune(
    frames: Annotated[str | None, typer.Option("--frames-older-than", help="Raw frames, an age as 90d.")] = None,
    files: Annotated[str | None, typer.Option("--files-older-than", help="Pictures, listings, profiles.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Tell what would go, and let it stay.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Remove the raw frames and the files of old results; the results stay."""
    from server.keeping.errors import KeepingError
    from server.keeping.prune import Ages, parse_age
    from server.keeping.prune import prune as prune_store
    from server.settings import settings
    from server.store.blobs import Blobs
    from server.store.database import Database

    if frames is None and files is None:
        raise KeepingError("Say what may go: --frames-older-than 90d, --files-older-than 180d, or both.")
    ages = Ages(*(None if age is None else parse_age(age) for age in (frames, files)))
    chosen = settings()
    database = Database(chosen.database_url)
    try:
        done = prune_store(database, Blobs(chosen.blobs), ages, dry_run=dry_run)
    finally:
        database.close()
    if as_json:
        print_json({"dry_run": dry_run, **asdict(done)})
        return
    verb = "Would prune" if dry_run else "Pruned"
    typer.echo(
        f"{verb} the raw frames of {done.frames} results ({done.frames_bytes / 1e6:.1f} MB), the files of {done.files} "
        f"results and {done.profiles} profiles ({done.blobs} files, {done.blobs_bytes / 1e6:.1f} MB)."
    )


def _tell(verb: str, report: Report, as_json: bool) -> None:
    manifest = report.manifest
    if as_json:
        print_json({**asdict(manifest), "blobs": report.blobs, "bytes": report.bytes})
        return
    typer.echo(
        f"{verb} {manifest.jobs} jobs, {manifest.results} results and {report.blobs} files ({report.bytes} bytes)."
    )
