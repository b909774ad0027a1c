"""Blobs: files named by the SHA-256 of their content, gzipped, in one folder. They are only ever added."""

from __future__ import annotations

import gzip
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

CHUNK = 1 << 18
LEVEL = 1
"""Profiles are figures as text: more than the least effort takes three times as long for a tenth of the size."""


class BlobError(RuntimeError):
    """A folder that cannot be used, or a blob that is not in it; the message is one sentence that says what to do."""


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
    """The blobs of a folder, which is made when it is first written to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.expanduser()

    @contextmanager
    def receiving(self) -> Iterator[Incoming]:
        """A file to be written; raise BlobError when the folder cannot be."""
        with self._writing("incoming-") as (file, path):
            yield Incoming(file, path)

    def keep(self, incoming: Incoming) -> str:
        """Make a blob of what was received, whole or not at all; return its name."""
        incoming.flush()
        name = incoming.sha256
        target = self._path(name)
        if not target.exists():
            with self._writing("packing-") as (file, path), incoming.path.open("rb") as source:
                # No name and no time in the header: the same content gives the same bytes.
                with gzip.GzipFile("", "wb", LEVEL, file, mtime=0) as packed:
                    shutil.copyfileobj(source, packed, CHUNK)
                file.flush()
                os.fsync(file.fileno())
                target.parent.mkdir(exist_ok=True)
                os.replace(path, target)
        return name

    def read(self, name: str) -> Iterator[bytes]:
        """A blob's content, piece by piece; raise BlobError at once when it is not there."""
        try:
            packed = gzip.open(self._path(name), "rb")  # noqa: SIM115
        except OSError as error:
            raise BlobError(f"The file is not in this server's folder {self.folder}: set RAYFARM_BLOBS.") from error
        return _pieces(packed)

    def _path(self, name: str) -> Path:
        return self.folder / name[:2] / f"{name}.gz"

    @contextmanager
    def _writing(self, prefix: str) -> Iterator[tuple[BinaryIO, Path]]:
        path = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(prefix=prefix, dir=self.folder)
            path = Path(name)
            with os.fdopen(handle, "wb") as file:
                yield file, path
        except OSError as error:
            reason = error.strerror or str(error)
            raise BlobError(f"The folder {self.folder} cannot be written ({reason}): set RAYFARM_BLOBS.") from error
        finally:
            if path is not None:
                path.unlink(missing_ok=True)


def _pieces(packed: gzip.GzipFile) -> Iterator[bytes]:
    with packed:
        while chunk := packed.read(CHUNK):
            yield chunk
