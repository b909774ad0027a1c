"""Where blobs lie: a folder, or a bucket that speaks S3. Both hold them packed, as `ab/abcd....gz`, and only whole.

A folder is written here rather than by obstore, whose local store renames a file into place without flushing it to
the disk, so that a power cut could leave a half one, and would copy what is packed already a second time.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Protocol

import obstore
from obstore.exceptions import BaseError
from obstore.store import S3Store

if TYPE_CHECKING:
    from obstore.store import RetryConfig

S3 = "s3://"
CHUNK = 1 << 18
PART = 5 << 20
"""The smallest part that S3 takes of a large upload; two of them are in memory at once."""
RETRY_S = 20
MAX_REASON = 300
_BLOB = re.compile(r"[0-9a-f]{64}")


class BlobError(RuntimeError):
    """A place that cannot be used, or a blob that is not in it; the message is one sentence that says what to do."""


class Place(Protocol):
    """A place for packed blobs; every method raises BlobError where it cannot be used."""

    def scratch(self, prefix: str) -> AbstractContextManager[tuple[BinaryIO, Path]]:
        """A new file that is gone at the end, unless it was added."""
        ...

    def has(self, name: str) -> bool:
        """Whether a blob is there."""
        ...

    def add(self, name: str, file: BinaryIO, path: Path) -> None:
        """Make a blob of a written scratch file."""
        ...

    def open(self, name: str) -> Iterator[bytes]:
        """A blob as it lies there, piece by piece; BlobError at once when it is not there."""
        ...

    def touch(self, name: str) -> None:
        """Note that a blob was wanted anew."""
        ...

    def older(self, time: datetime) -> Iterator[tuple[str, int]]:
        """The blobs that were added or touched last before a time, with their sizes."""
        ...

    def remove(self, name: str, before: datetime) -> None:
        """Remove a blob, unless it was added or touched since a time."""
        ...


def open_place(where: Path | str) -> Place:
    """The place at `s3://bucket/prefix`, or the folder of that name; nothing is asked of it yet."""
    return Bucket(where) if isinstance(where, str) and where.startswith(S3) else Folder(Path(where))


class Folder:
    """A folder, which is made when it is first written to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.expanduser()

    @contextmanager
    def scratch(self, prefix: str) -> Iterator[tuple[BinaryIO, Path]]:
        """A file beside the blobs, so that it can become one by its name alone."""
        with _told(f"The folder {self.folder} cannot be written"):
            self.folder.mkdir(parents=True, exist_ok=True)
            with _temporary(prefix, self.folder) as written:
                yield written

    def has(self, name: str) -> bool:
        """Whether a blob is there."""
        return self._path(name).exists()

    def add(self, name: str, file: BinaryIO, path: Path) -> None:
        """Flush the file to the disk, then give it its name."""
        target = self._path(name)
        file.flush()
        os.fsync(file.fileno())
        target.parent.mkdir(exist_ok=True)
        os.replace(path, target)

    def open(self, name: str) -> Iterator[bytes]:
        """Read a blob's file."""
        try:
            file = self._path(name).open("rb")
        except OSError as error:
            raise BlobError(f"The file is not in this server's folder {self.folder}: set RAYFARM_BLOBS.") from error
        return _pieces(file)

    def touch(self, name: str) -> None:
        """Set the file's time."""
        with _told(f"The folder {self.folder} cannot be written"):
            os.utime(self._path(name))

    def older(self, time: datetime) -> Iterator[tuple[str, int]]:
        """Files by their times."""
        for path in sorted(self.folder.glob("[0-9a-f][0-9a-f]/*.gz")):
            with suppress(FileNotFoundError):
                found = path.stat()
                if _BLOB.fullmatch(path.stem) and found.st_mtime < time.timestamp():
                    yield path.stem, found.st_size

    def remove(self, name: str, before: datetime) -> None:
        """Remove the file."""
        path = self._path(name)
        with _told(f"The folder {self.folder} cannot be written"), suppress(FileNotFoundError):
            if path.stat().st_mtime < before.timestamp():
                path.unlink()

    def _path(self, name: str) -> Path:
        return self.folder / name[:2] / f"{name}.gz"


class Bucket:
    """A bucket, or a prefix in one; obstore reads its credentials and endpoint from the variables `AWS_...`."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")
        try:
            retries: RetryConfig = {"max_retries": 3, "retry_timeout": timedelta(seconds=RETRY_S)}
            self._store = S3Store.from_url(self.url, retry_config=retries)
        except BaseError as error:
            raise self._unusable("used", error) from error

    @contextmanager
    def scratch(self, prefix: str) -> Iterator[tuple[BinaryIO, Path]]:
        """A file in the machine's temporary folder."""
        with _told("The temporary folder cannot be written"), _temporary(f"rayfarm-{prefix}", None) as written:
            yield written

    def has(self, name: str) -> bool:
        """Whether a blob is there."""
        try:
            obstore.head(self._store, _key(name))
        except FileNotFoundError:
            return False
        except (BaseError, OSError) as error:
            raise self._unusable("read", error) from error
        return True

    def add(self, name: str, file: BinaryIO, path: Path) -> None:
        """Upload the file; a bucket shows an object once all of it is there."""
        file.flush()
        try:
            obstore.put(self._store, _key(name), path, chunk_size=PART, max_concurrency=2)
        except (BaseError, OSError) as error:
            raise self._unusable("written", error) from error

    def open(self, name: str) -> Iterator[bytes]:
        """Download a blob."""
        try:
            stream = obstore.get(self._store, _key(name)).stream(min_chunk_size=CHUNK)
        except FileNotFoundError as error:
            raise BlobError(f"The file is not in this server's bucket {self.url}: set RAYFARM_BLOBS.") from error
        except (BaseError, OSError) as error:
            raise self._unusable("read", error) from error
        return self._downloaded(stream)

    def touch(self, name: str) -> None:
        """Nothing: an object's time is that of its upload."""

    def older(self, time: datetime) -> Iterator[tuple[str, int]]:
        """Objects by the times of their uploads."""
        try:
            for page in obstore.list(self._store):
                for found in page:
                    name = found["path"].rpartition("/")[2].removesuffix(".gz")
                    if _BLOB.fullmatch(name) and found["last_modified"] < time:
                        yield name, found["size"]
        except (BaseError, OSError) as error:
            raise self._unusable("read", error) from error

    def remove(self, name: str, before: datetime) -> None:
        """Delete the object."""
        try:
            if obstore.head(self._store, _key(name))["last_modified"] < before:
                obstore.delete(self._store, _key(name))
        except FileNotFoundError:
            pass
        except (BaseError, OSError) as error:
            raise self._unusable("written", error) from error

    def _downloaded(self, stream: Iterator[bytes]) -> Iterator[bytes]:
        try:
            for piece in stream:
                yield memoryview(piece).tobytes()
        except (BaseError, OSError) as error:
            raise self._unusable("read", error) from error

    def _unusable(self, what: str, error: Exception) -> BlobError:
        # After the first line come obstore's dump of the error and the answer's XML.
        reason = re.split(r"\n|<\?xml", str(error))[0].rstrip(" .:")[:MAX_REASON] or type(error).__name__
        return BlobError(f"The bucket {self.url} cannot be {what} ({reason}): check RAYFARM_BLOBS and AWS_... .")


def _key(name: str) -> str:
    return f"{name[:2]}/{name}.gz"


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    with file:
        while piece := file.read(CHUNK):
            yield piece


@contextmanager
def _told(sentence: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise BlobError(f"{sentence} ({reason}): set RAYFARM_BLOBS.") from error


@contextmanager
def _temporary(prefix: str, folder: Path | None) -> Iterator[tuple[BinaryIO, Path]]:
    handle, name = tempfile.mkstemp(prefix=prefix, dir=folder)
    path = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            yield file, path
    finally:
        path.unlink(missing_ok=True)
