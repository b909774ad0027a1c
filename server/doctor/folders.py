"""The folders that are written to, and their disks; the folders that scenes are looked for in."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from renderer.locks import lock_folder
from scenes import places
from scenes.kept import cache_folder
from server.doctor.finding import Said
from server.settings import settings
from server.store.blob_places import S3

LEAST_FREE = 1 << 30
FEW_FREE = 5 << 30
"""Bytes: below the first nothing that is measured may be kept, below the second it is time to make room."""


def folders() -> Iterator[Said]:
    """Whether each folder can be written to, and has room."""
    for what, variable, folder in _written():
        reason = _refusal(folder)
        if reason is not None:
            yield "missing", f"The folder {folder} of {what} cannot be written ({reason}): correct {variable}."
            continue
        free = shutil.disk_usage(_nearest(folder)).free
        shown = f"{free / (1 << 30):.1f} GiB"
        if free < LEAST_FREE:
            yield "missing", f"The disk of {folder} ({what}) has {shown} left: make room, or set {variable}."
        elif free < FEW_FREE:
            yield "note", f"The disk of {folder} ({what}) has {shown} left: make room soon."
        else:
            yield "good", f"{what[0].upper()}{what[1:]}: {folder}, {shown} free."


def scenes() -> Iterator[Said]:
    """Whether the folders that are named are there."""
    listed = [part for part in os.environ.get(places.VARIABLE, "").split(os.pathsep) if part]
    for part in listed:
        if not Path(part).is_dir():
            yield "missing", f"{places.VARIABLE} names {part}, where no folder is: make it, or correct the variable."
    yield "good", f"Scene files are looked for in {', '.join(map(str, places.folders())) or 'no folder yet'}."


def _written() -> Iterator[tuple[str, str, Path]]:
    """What is kept, the variable that says where, and where."""
    blobs = settings().blobs
    if not blobs.startswith(S3):
        yield "pictures and profiles", "RAYFARM_BLOBS", Path(blobs).expanduser()
    yield "built trees", "RAYFARM_CACHE", cache_folder("trees")
    yield "locks", "RAYFARM_LOCKS", lock_folder()
    yield "compiled functions", "NUMBA_CACHE_DIR", _compiled()


def _compiled() -> Path:
    return Path(os.environ.get("NUMBA_CACHE_DIR") or Path(places.__file__).parents[1] / "renderer" / "__pycache__")


def _refusal(folder: Path) -> str | None:
    """Why a folder cannot be written to; None where it can, or could be made."""
    nearest = _nearest(folder)
    try:
        with tempfile.TemporaryFile(dir=nearest) as file:
            file.write(b"0")
    except OSError as error:
        return (error.strerror or str(error)).lower()
    return None


def _nearest(folder: Path) -> Path:
    """The folder, or the one in which it would be made."""
    return next(each for each in (folder, *folder.parents) if each.exists())
