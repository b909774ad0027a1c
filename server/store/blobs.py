"""Blobs: files named by the SHA-256 of their content, gzipped, in a folder or a bucket. They are only ever added."""

from __future__ import annotations

import gzip
import hashlib
import shutil
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from server.store.blob_places import CHUNK, BlobError, open_place

__all__ = ["BlobError", "Blobs", "Incoming"]

LEVEL = 1
"""Profiles are figures as text: more than the least effort takes three times as long for a tenth of the size."""
WITH_HEADER = 31
"""zlib's `wbits` for gzip."""


class Incoming:
    """A file that is being received; it becomes a blob when it is kept, and is gone otherwise."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self.path = path
        self.size = 0
        self._file = file
        self._digest = hashlib.sha256()

    @property
    def sha256(self) -> str:
        """The digest of what has come so far, in hexadecimal."""
        return self._digest.hexdigest()

    def write(self, chunk: bytes) -> None:
        """Take the next bytes."""
        self._file.write(chunk)
        self._digest.update(chunk)
        self.size += len(chunk)

    def flush(self) -> None:
        """Let readers of `path` see all of it."""
        self._file.flush()


class Blobs:
    """The blobs of a place: a folder, or `s3://bucket/prefix`."""

    def __init__(self, where: Path | str) -> None:
        self.where = str(where)
        self._place = open_place(where)

    @contextmanager
    def receiving(self) -> Iterator[Incoming]:
        """A file to be written; raise BlobError when it cannot be."""
        with self._place.scratch("incoming-") as (file, path):
            yield Incoming(file, path)

    def keep(self, incoming: Incoming) -> str:
        """Make a blob of what was received, whole or not at all; return its name."""
        incoming.flush()
        name = incoming.sha256
        self._keep(name, incoming.path)
        return name

    def keep_file(self, path: Path, sha256: str) -> None:
        """Make a blob of a file; raise BlobError when it is not there or is not what the digest says."""
        try:
            with path.open("rb") as file:
                found = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise BlobError(f"The file {path.name} cannot be read ({error.strerror}): measure again.") from error
        if found != sha256:
            raise BlobError(f"The file {path.name} has another content than its name says: measure again.")
        self._keep(sha256, path)

    def read(self, name: str) -> Iterator[bytes]:
        """A blob's content, piece by piece; raise BlobError at once when it is not there."""
        return _unpacked(self._place.open(name))

    def _keep(self, name: str, path: Path) -> None:
        if self._place.has(name):
            return
        with self._place.scratch("packing-") as (file, packing), path.open("rb") as source:
            # No name and no time in the header: the same content gives the same bytes.
            with gzip.GzipFile("", "wb", LEVEL, file, mtime=0) as packed:
                shutil.copyfileobj(source, packed, CHUNK)
            self._place.add(name, file, packing)


def _unpacked(packed: Iterator[bytes]) -> Iterator[bytes]:
    """What gzip packed, in pieces of at most CHUNK bytes however well it was packed."""
    unpacker = zlib.decompressobj(WITH_HEADER)
    try:
        for piece in packed:
            rest = piece
            while rest:
                if content := unpacker.decompress(rest, CHUNK):
                    yield content
                rest = unpacker.unconsumed_tail
        if content := unpacker.flush():
            yield content
    except zlib.error as error:
        raise BlobError("A stored file is damaged: it does not unpack.") from error
    if not unpacker.eof:
        raise BlobError("A stored file is damaged: it ends too soon.")
