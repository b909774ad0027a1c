"""Stored pictures read again, in bounded memory: they may have come from another machine."""

from __future__ import annotations

import tempfile
import zipfile
import zlib
from typing import IO

import numpy as np
import numpy.typing as npt
from PIL import Image

from renderer.pictures.files import PictureError, read_array
from renderer.request import MAX_SIDE
from server.store.blobs import Blobs

Pixels = npt.NDArray[np.uint8]
Counts = npt.NDArray[np.uint32]

IN_MEMORY = 16 << 20
"""A packed picture above this is unpacked from a temporary file."""
MOST_BYTES = 256 << 20
"""Three counts of a picture of the largest size that do not pack at all."""


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
                return read_array(member)[::-1]
        except (KeyError, OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
            raise PictureError(f"The stored counts {sha256[:12]} cannot be read ({error}): measure again.") from error


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
