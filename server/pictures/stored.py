"""Stored pictures read again, in bounded memory: they may have come from another machine."""

from __future__ import annotations

import tempfile
import zipfile
import zlib
from typing import IO

import numpy as np
import numpy.typing as npt
from PIL import Image

from renderer.pictures import PictureError
from renderer.request import MAX_SIDE
from server.store.blobs import Blobs

Pixels = npt.NDArray[np.uint8]
Counts = npt.NDArray[np.uint32]

IN_MEMORY = 16 << 20
"""A packed picture above this is unpacked from a temporary file."""
MOST_BYTES = 256 << 20
"""Three counts of a picture of the largest size that do not pack at all."""
MAX_HEADER = 4096


def read_image(blobs: Blobs, sha256: str) -> Pixels:
    """A rendered image, (h, w, 3), the top row first; raise BlobError or PictureError when it cannot be read."""
    with _spooled(blobs, sha256) as file:
        try:
            with Image.open(file, formats=("PNG",)) as image:
                if max(image.size) > MAX_SIDE:
                    raise ValueError(f"it is larger than {MAX_SIDE}x{MAX_SIDE} pixels")
                return np.asarray(image.convert("RGB"))
        except (OSError, ValueError, SyntaxError) as error:
            raise PictureError(f"The stored image {sha256[:12]} cannot be read ({error}): measure again.") from error


def read_counts(blobs: Blobs, sha256: str, metric: str) -> Counts:
    """One count of every pixel, (h, w), the top row first as in an image; raise BlobError or PictureError."""
    with _spooled(blobs, sha256) as file:
        try:
            with zipfile.ZipFile(file) as held, held.open(f"{metric}.npy") as member:
                return _read_array(member)[::-1]
        except (KeyError, OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
            raise PictureError(f"The stored counts {sha256[:12]} cannot be read ({error}): measure again.") from error


def _read_array(member: IO[bytes]) -> Counts:
    """A numpy array whose size is checked before room is made for it."""
    if np.lib.format.read_magic(member) != (1, 0):
        raise ValueError("they are not of this program")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(member, max_header_size=MAX_HEADER)
    if dtype != np.dtype("<u4") or fortran or len(shape) != 2 or not all(0 < side <= MAX_SIDE for side in shape):
        raise ValueError("they are not of this program")
    size = 4 * shape[0] * shape[1]
    body = member.read(size)
    if len(body) != size:
        raise ValueError("they end too soon")
    return np.frombuffer(body, "<u4").reshape(shape)


def _spooled(blobs: Blobs, sha256: str) -> IO[bytes]:
    pieces, size = blobs.read(sha256), 0
    file = tempfile.SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115
    try:
        for piece in pieces:
            size += len(piece)
            if size > MOST_BYTES:
                raise PictureError(f"The stored picture {sha256[:12]} has more than {MOST_BYTES >> 20} MB.")
            file.write(piece)
        file.seek(0)
    except BaseException:
        file.close()
        raise
    return file
