"""Arrays in files that `numpy.load` reads, laid so that they can be mapped instead of read.

Memory that a process touches for the first time costs more than the bytes in it; pages of a file that was read before
are there already.
"""

from __future__ import annotations

import mmap
import struct
import zipfile
import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from numpy.lib import format as npy

Array = npt.NDArray[Any]

ALIGN = 64
_LOCAL_HEADER = 30
"""Bytes of a member's header before its name (PKWARE APPNOTE 4.3.7); the lengths of name and extra field end it."""
_PADDING = 0xD935
"""The extra field by which Android's zipalign says that it only pads."""


def write_arrays(file: BinaryIO, arrays: Mapping[str, Array]) -> None:
    """Write an npz archive, uncompressed, each array's first byte at a multiple of 64."""
    with zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy")
            at = file.tell() + _LOCAL_HEADER + len(member.filename) + 4
            member.extra = struct.pack("<HH", _PADDING, -at % ALIGN) + bytes(-at % ALIGN)
            member.file_size = array.nbytes + 4096  # An upper bound, by which zipfile chooses the header's form.
            with archive.open(member, "w") as out:
                npy.write_array(out, np.asarray(array), allow_pickle=False)


def map_arrays(file: BinaryIO) -> dict[str, Array]:
    """The arrays of an npz archive, mapped copy on write; raise an exception where a checksum fails.

    Arrays that lie at odd places, as `numpy.savez` puts them, are copied.
    """
    pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
    with zipfile.ZipFile(file) as archive:
        return {member.filename.removesuffix(".npy"): _array(pages, member) for member in archive.infolist()}


def _array(pages: mmap.mmap, member: zipfile.ZipInfo) -> Array:
    name_length, extra_length = struct.unpack_from("<HH", pages, member.header_offset + _LOCAL_HEADER - 4)
    begin = member.header_offset + _LOCAL_HEADER + name_length + extra_length
    data = memoryview(pages)[begin : begin + member.file_size]
    if member.compress_type != zipfile.ZIP_STORED or zlib.crc32(data) != member.CRC:
        raise zipfile.BadZipFile(f"{member.filename} is damaged.")
    head = BytesIO(data[:4096])
    version = npy.read_magic(head)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read_header(head)
    if fortran or dtype.hasobject:
        raise ValueError(f"{member.filename} is no plain array.")
    found: Array = np.frombuffer(data[head.tell() :], dtype).reshape(shape)
    return found if found.ctypes.data % ALIGN == 0 or not found.size else found.copy()
