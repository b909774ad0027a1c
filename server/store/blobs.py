"""Blobs: files named by the SHA-256 of their content, gzipped, in a folder or a bucket; added, and at last pruned."""

from __future__ import annotations

import gzip
import hashlib
import shutil
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from server.store.blob_places import CHUNK, BlobError, open_place

__all__ = ["BlobError", "Blobs", "Incoming"]

LEVEL = 1
"""Profiles are figures as text: more than the least effort takes three times as long for a tenth of the size."""
WITH_HEADER = 31
"""zlib's `wbits` for gzip."""


class DamagedError(BlobError):
    """A blob that does not hold what was kept."""


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
        return self._checked(name, self._place.open(name))

    def _checked(self, name: str, packed: Iterator[bytes]) -> Iterator[bytes]:
        """The content; a blob that is damaged is removed, so that the same content can be kept again."""
        digest = hashlib.sha256()
        try:
            for piece in _unpacked(packed):
                digest.update(piece)
                yield piece
            if digest.hexdigest() != name:
                raise DamagedError("A stored file is damaged: it has another content than its name says.")
        except DamagedError:
            self._place.remove(name, datetime.now(UTC))
            raise

    @contextmanager
    def packed(self, name: str) -> Iterator[BinaryIO]:
        """A blob as it lies there, gzipped, in a temporary file; raise BlobError when it is not there."""
        with tempfile.TemporaryFile() as file:
            for piece in self._place.open(name):
                file.write(piece)
            yield file

    def keep_packed(self, name: str, packed: BinaryIO) -> None:
        """Make a blob of what `packed` gave; raise BlobError when that is not what the name says."""
        with self._place.scratch("restoring-") as (file, path):
            shutil.copyfileobj(packed, file, CHUNK)
            file.flush()
            digest = hashlib.sha256()
            with path.open("rb") as source:
                for piece in _unpacked(iter(lambda: source.read(CHUNK), b"")):
                    digest.update(piece)
            if digest.hexdigest() != name:
                raise DamagedError(f"The file {name[:12]} has another content than its name says.")
            if not self._place.has(name):
                self._place.add(name, file, path)

    def kept_before(self, time: datetime) -> Iterator[tuple[str, int]]:
        """The blobs that were last kept before a time, with their sizes in bytes as they lie there."""
        return self._place.older(time)

    def remove(self, name: str, before: datetime) -> None:
        """Remove a blob that nobody needs, unless it was kept again since a time."""
        self._place.remove(name, before)

    def _keep(self, name: str, path: Path) -> None:
        if self._place.has(name):
            self._place.touch(name)
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
        raise DamagedError("A stored file is damaged: it does not unpack.") from error
    if not unpacker.eof:
        raise DamagedError("A stored file is damaged: it ends too soon.")
