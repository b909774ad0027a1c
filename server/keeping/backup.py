"""A whole store in one file, and back: the database as its own tools copy it, and the blobs as they lie.

The file is a tar archive: `manifest.json`, `database`, then `blobs/ab/abcd....gz`. The database is copied first: blobs
are only ever added, so every blob that it names is still to come.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

from sqlalchemy import func, select

from server.devices import registry
from server.keeping.copies import load, save
from server.keeping.errors import KeepingError
from server.store.blobs import Blobs
from server.store.database import Database
from server.store.engines import make_engine
from server.store.errors import shown
from server.store.models import Device, HardCaseRun, Job, Profile, Result, Study, Token, now

FORMAT = 1
CHUNK = 1 << 20
KEPT = (Study, Job, Result, HardCaseRun, Profile, Token, Device)
"""The tables that make a store one that has something to lose."""
_BLOB = re.compile(r"blobs/([0-9a-f]{2})/(\1[0-9a-f]{62})\.gz")


@dataclass(frozen=True)
class Manifest:
    """What a backup is: `kind` of database, `digest` of its copy, and how many jobs and results are in it."""

    kind: str
    digest: str
    jobs: int
    results: int
    rayfarm: str
    made_at: str
    format: int = FORMAT


@dataclass(frozen=True)
class Report:
    """What was backed up or restored."""

    manifest: Manifest
    blobs: int
    bytes: int


def back_up(url: str, blobs: Blobs, file: Path) -> Report:
    """Write a backup of the store, while it may be in use; raise KeepingError, and leave no file, where that fails."""
    if file.exists():
        raise KeepingError(f"There is a file {file} already: name another.")
    database = Database(url)  # An older store is brought up to date first.
    try:
        with _beside(file) as (part, copy):
            save(database.engine.url, copy)
            with database.reading() as session:
                jobs, results = (session.scalar(select(func.count(table.id))) or 0 for table in (Job, Result))
            kind, digest = database.engine.dialect.name, _digest(copy)
            manifest = Manifest(kind, digest, jobs, results, version("rayfarm"), now().isoformat(timespec="seconds"))
            count = _write(part, manifest, copy, blobs)
            os.link(part, file)  # Unlike a rename this replaces nothing.
    finally:
        database.close()
    return Report(manifest, count, file.stat().st_size)


def restore(url: str, blobs: Blobs, file: Path, *, overwrite: bool = False) -> Report:
    """Put a backup in place of an empty store, or of any store with `overwrite`.

    Raise KeepingError for what is no whole backup, a store of the other kind of database, and one that is not empty.
    """
    engine = make_engine(url)
    target, kind = engine.url, engine.dialect.name
    engine.dispose()
    with _reading(file) as archive, tempfile.TemporaryDirectory(prefix="rayfarm-restore-") as folder:
        manifest = _manifest(archive)
        if manifest.kind != kind:
            raise KeepingError(
                f"This is a backup of {manifest.kind}, and {shown(target)} is {kind}: set the URL of one."
            )
        copy = Path(folder) / "database"
        _extract(archive, "database", copy)
        if _digest(copy) != manifest.digest:
            raise KeepingError(f"The backup {file} is damaged: its database is not what was written; use another.")
        _require_free(url, overwrite)
        load(target, copy)
        count = _restore_blobs(archive, blobs)
    Database(url).close()
    return Report(manifest, count, file.stat().st_size)


@contextmanager
def _beside(file: Path) -> Iterator[tuple[Path, Path]]:
    """Two files that are gone at the end: the backup as it grows, the database's copy; nobody else may read them."""
    try:
        with tempfile.TemporaryDirectory(prefix=".rayfarm-backup-", dir=file.absolute().parent) as folder:
            yield Path(folder) / "part", Path(folder) / "database"
    except OSError as error:
        raise KeepingError(f"The backup {file} cannot be written ({error.strerror}): name another place.") from error


def _write(part: Path, manifest: Manifest, copy: Path, blobs: Blobs) -> int:
    count = 0
    with part.open("wb") as out, tarfile.open(fileobj=out, mode="w") as archive:
        os.fchmod(out.fileno(), 0o600)
        _add(archive, "manifest.json", io.BytesIO(json.dumps(asdict(manifest)).encode()))
        with copy.open("rb") as file:
            _add(archive, "database", file)
        for name, _size in blobs.kept_before(now()):
            with blobs.packed(name) as file:
                _add(archive, f"blobs/{name[:2]}/{name}.gz", file)
            count += 1
        archive.close()
        out.flush()
        os.fsync(out.fileno())
    return count


def _add(archive: tarfile.TarFile, name: str, file: IO[bytes]) -> None:
    info = tarfile.TarInfo(name)
    info.size, info.mode = file.seek(0, os.SEEK_END), 0o600
    file.seek(0)
    archive.addfile(info, file)


@contextmanager
def _reading(file: Path) -> Iterator[tarfile.TarFile]:
    try:
        with tarfile.open(file, "r|") as archive:
            yield archive
    except (OSError, EOFError, tarfile.TarError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise KeepingError(f"{file} is no whole backup ({reason}): use another.") from error


def _manifest(archive: tarfile.TarFile) -> Manifest:
    member = archive.next()
    if member is None or member.name != "manifest.json" or member.size > CHUNK:
        raise KeepingError("This is no backup of RayFarm: name a file that `rayfarm backup` wrote.")
    said: Any = json.loads(_content(archive, member).read())
    if said.get("format") != FORMAT:
        raise KeepingError("This backup is of a later RayFarm: update this one.")
    return Manifest(**said)


def _extract(archive: tarfile.TarFile, name: str, to: Path) -> None:
    member = archive.next()
    if member is None or member.name != name:
        raise KeepingError("This backup holds no database: use another.")
    with to.open("wb") as out:
        _copy(_content(archive, member), out.write)


def _restore_blobs(archive: tarfile.TarFile, blobs: Blobs) -> int:
    count = 0
    while (member := archive.next()) is not None:
        found = _BLOB.fullmatch(member.name)
        if found is None:
            raise KeepingError(f"This backup holds {member.name[:80]!r}, which no backup does: use another.")
        blobs.keep_packed(found[2], _content(archive, member))
        count += 1
    return count


def _require_free(url: str, overwrite: bool) -> None:
    """Raise KeepingError where somebody works on the store, or it has anything and is not to be overwritten."""
    database = Database(url)
    try:
        with database.reading() as session:
            alive = registry.held_hosts(session)
            held = any(session.execute(select(table.id).limit(1)).first() for table in KEPT)
    finally:
        database.close()
    if held and not overwrite:
        raise KeepingError(f"{shown(database.engine.url)} is not empty: name an empty one, or say --overwrite.")
    if alive:
        raise KeepingError("A worker is registered there: end servers and workers first, or let it be given up.")


def _content(archive: tarfile.TarFile, member: tarfile.TarInfo) -> BinaryIO:
    content = archive.extractfile(member) if member.isreg() else None
    if content is None:
        raise KeepingError(f"The backup's {member.name[:80]!r} is no file: use another.")
    return cast(BinaryIO, content)


def _copy(source: IO[bytes], take: Callable[[bytes], object]) -> None:
    while chunk := source.read(CHUNK):
        take(chunk)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
