"""Where scene files lie: the folders of RAYFARM_SCENES, then the user's cache."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import platformdirs

from scenes.entry import Entry, SourceFile

VARIABLE = "RAYFARM_SCENES"


def cache_folder() -> Path:
    """The user's folder for fetched scenes; it need not exist yet."""
    return Path(platformdirs.user_cache_dir("rayfarm")) / "scenes"


def folders() -> list[Path]:
    """The folders that are searched, in order; those that do not exist are left out."""
    listed = [Path(part) for part in os.environ.get(VARIABLE, "").split(os.pathsep) if part]
    return [folder for folder in (*listed, cache_folder()) if folder.is_dir()]


def find_named(name: str) -> Path | None:
    """The first file called `name` in the folders."""
    return next((folder / name for folder in folders() if (folder / name).is_file()), None)


def find_source(entry: Entry, *, verified: bool = False) -> tuple[Path, SourceFile] | None:
    """The first form of the entry's geometry that is here; `verified` passes over those of another checksum."""
    for file in entry.forms:
        for path in _candidates(file):
            if not verified or file.sha256 is None or sha256(path) == file.sha256:
                return path, file
    return None


def _candidates(file: SourceFile) -> Iterator[Path]:
    for folder in folders():
        for path in sorted(folder.glob(file.name)):
            if path.is_file() and _fits(path, file):
                yield path


def _fits(path: Path, file: SourceFile) -> bool:
    """A file found by a pattern has to prove itself at once; one with its own name when it is loaded."""
    if file.size is None:
        return True
    return path.stat().st_size == file.size and (file.sha256 is None or sha256(path) == file.sha256)


def sha256(path: Path) -> str:
    """The hexadecimal sha256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
