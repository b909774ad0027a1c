"""What reading one mesh file may take: memory, and what an archive unpacks to."""

from __future__ import annotations

import os
import resource
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenes.scene import SceneError

MAX_UNPACKED = 1 << 30
"""Bytes of all members of an archive together, counted as they unpack: what an archive says of itself is a claim."""
_PIECE = 1 << 20


@contextmanager
def bounded_memory(extra: int | None = None) -> Iterator[None]:
    """Let this process take `extra` bytes more, by default half of this machine's memory; beyond, MemoryError.

    The limit is one of address space, for the process: nothing else of it should be allocating meanwhile.
    """
    more = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2 if extra is None else extra
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = _address_space() + more
    if soft != resource.RLIM_INFINITY:
        limit = min(limit, soft)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def require_small_archive(path: Path, most: int = MAX_UNPACKED) -> None:
    """Raise SceneError when a zip file (3MF is one) unpacks to more than `most` bytes, or is none."""
    taken = 0
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                with archive.open(member) as content:
                    while piece := content.read(_PIECE):
                        taken += len(piece)
                        if taken > most:
                            raise SceneError(f"{path.name} unpacks to more than {most >> 20} MiB: convert it to PLY.")
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise SceneError(f"{path.name} is damaged, or packed in a way that is not read: convert it to PLY.") from error


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
