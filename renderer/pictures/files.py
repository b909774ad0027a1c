"""A measurement's pictures as files: the rendered image, and what every pixel's rays fetched.

A file is named by the sha256 of its bytes, so that identical pictures of different variants are one file.
"""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TypedDict

import numpy as np
import numpy.typing as npt
from PIL import Image

from renderer.pictures.counts import METRICS, Counts
from renderer.request import MAX_SIDE

_MAX_HEADER = 4096
_MAX_BYTES = len(METRICS) * (MAX_SIDE * MAX_SIDE * 4 + _MAX_HEADER)


class PictureError(ValueError):
    """A file of counts that cannot be read; the message says why in one sentence."""


class Pictures(TypedDict):
    """The sha256 of each picture; `counts` is None where nothing was counted."""

    image: str
    counts: str | None


def write_pictures(folder: Path, image: npt.NDArray[np.uint8], counts: Mapping[str, Counts] | None) -> Pictures:
    """Write `SHA.png` and `SHA.npz` into `folder` and return their names without the suffix.

    `image` is (h, w, 3 or 4) with row 0 at the bottom; the PNG is RGB, top row first. `counts` holds an (h, w) array,
    row 0 at the bottom, for each of METRICS; the file keeps them as uint32 and in that order.
    """
    return {
        "image": _write(folder, ".png", png_bytes(image)),
        "counts": None if counts is None else _write(folder, ".npz", counts_bytes(counts)),
    }


def png_bytes(image: npt.NDArray[np.uint8]) -> bytes:
    """An image with row 0 at the bottom as a PNG; the same bytes for the same pixels."""
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image[::-1, :, :3])).save(out, "png")
    return out.getvalue()


def counts_bytes(counts: Mapping[str, Counts]) -> bytes:
    """Counts as an .npz; the same bytes for the same counts."""
    out = io.BytesIO()
    # numpy gives every member the zip format's first date, so that no clock gets in.
    parts = {name: _words(counts[name]) for name in METRICS}
    np.savez_compressed(out, allow_pickle=False, **parts)
    return out.getvalue()


def read_counts(source: Path | bytes) -> dict[str, Counts]:
    """Read what `write_pictures` wrote: (h, w) int64 for each of METRICS, row 0 at the bottom.

    The file may come from anywhere: it is read in bounded memory. Raise PictureError when it holds anything else.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(source) if isinstance(source, bytes) else source) as held:
            _refuse_foreign(held)
            counts = {name: _member(held, name) for name in METRICS}
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
        raise PictureError(f"The counts cannot be read ({error}): measure again.") from error
    if len({part.shape for part in counts.values()}) != 1:
        raise PictureError("The counts cannot be read (their sizes differ): measure again.")
    return counts


def _refuse_foreign(held: zipfile.ZipFile) -> None:
    sizes = {part.filename: part.file_size for part in held.infolist()}
    if sizes.keys() != {f"{name}.npy" for name in METRICS} or len(held.infolist()) != len(METRICS):
        raise ValueError("they are not of this program")
    if sum(sizes.values()) > _MAX_BYTES:
        raise ValueError(f"they are larger than {MAX_SIDE}x{MAX_SIDE} pixels")


def read_array(member: IO[bytes]) -> npt.NDArray[np.uint32]:
    """One count of every pixel from its member of the file, (h, w); raise ValueError when it holds anything else.

    It is read to its end first, where zipfile checks its CRC: numpy parses a torn header as Python. numpy would also
    make room for whatever the header claims, so the size is checked before that.
    """
    data = member.read(_MAX_HEADER + 4 * MAX_SIDE**2)
    stream = io.BytesIO(data)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("they are not of this program")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=_MAX_HEADER)
    if dtype != np.dtype("<u4") or fortran or len(shape) != 2 or not all(0 < side <= MAX_SIDE for side in shape):
        raise ValueError("they are not of this program")
    body = memoryview(data)[stream.tell() :]
    size = 4 * shape[0] * shape[1]
    if len(body) < size:
        raise ValueError("they end too soon")
    if len(body) > size:
        raise ValueError("they are not of this program")
    return np.frombuffer(body, "<u4").reshape(shape)


def _member(held: zipfile.ZipFile, name: str) -> Counts:
    with held.open(f"{name}.npy") as member:
        return read_array(member).astype(np.int64)


def _words(counts: Counts) -> npt.NDArray[np.uint32]:
    return np.minimum(counts, np.iinfo(np.uint32).max).astype("<u4")


def _write(folder: Path, suffix: str, data: bytes) -> str:
    """Write a file by the name of its content, whole or not at all; others may write the same one."""
    sha = hashlib.sha256(data).hexdigest()
    part = folder / f"{sha}.{os.getpid()}.part"
    part.write_bytes(data)
    part.replace(folder / (sha + suffix))
    return sha
