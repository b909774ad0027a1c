"""What is costly to make, kept on disk and found again by what it was made from."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

from platformdirs import user_cache_dir

Made = TypeVar("Made")


def cache_folder(kind: str) -> Path:
    """Where things of a kind are kept: $RAYFARM_CACHE/KIND, else in the user's cache folder for rayfarm."""
    return Path(os.environ.get("RAYFARM_CACHE") or user_cache_dir("rayfarm")) / kind


def key_of(*parts: object) -> str:
    """A file's name for what something is made from, told apart by the parts' `repr`."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def kept(
    path: Path,
    read: Callable[[BinaryIO], Made],
    make: Callable[[], Made],
    write: Callable[[BinaryIO, Made], None],
) -> Made:
    """What is at `path`, or what `make` gives, which is then written there.

    An entry that cannot be read is made again and replaced. Several processes may ask at once: each writes a file of
    its own and renames it into place.
    """
    # Damaged bytes make zipfile and numpy raise nearly anything; a flipped bit fails the archive's CRC.
    with contextlib.suppress(Exception), path.open("rb") as file:
        return read(file)
    made = make()
    # A cache that is full or read-only costs the next run the making, not this one its result.
    with contextlib.suppress(OSError):
        write_whole(path, lambda file: write(file, made))
    return made


def write_whole(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Write a file that nobody sees before it is whole, and its folder where it is missing; raise OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
