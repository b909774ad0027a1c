"""Packed buffers kept on disk between the rounds of a job, each a fresh process that would pack the same again.

An entry is a JSON document that names its buffers by their sha256; variants that share a buffer share its file. What
was not used for longest goes first.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from renderer.build.parallel import each
from renderer.pack.api import Packed
from renderer.pack.grid import Grid
from renderer.pack.nodes import PackedNodes
from renderer.pack.primitives import PackedPrimitives
from renderer.request import Request
from scenes.kept import cache_folder, kept, key_of, write_whole
from scenes.scene import Scene

Array = npt.NDArray[Any]
Json = dict[str, Any]

MOST_BYTES = 2 << 30
"""What the folder may hold; the paper's 36 variants of a million triangles take half of it."""

_KINDS: dict[str, Any] = {kind.__name__: kind for kind in (Packed, PackedNodes, PackedPrimitives, Grid)}
_SOURCES = (
    "pack/*.py",
    "build/levels.py",
    "build/merging.py",
    "build/pruned.py",
    "build/tree.py",
    "build/wide.py",
    "kept_packed.py",
)
"""What makes the buffers of a tree, by whose text entries are told apart."""


def kept_packed(scene: Scene, request: Request, make: Callable[[], Packed]) -> Packed:
    """What `make` packs of a scene for a request, or packed when it last was asked to."""
    folder = cache_folder("packed")
    asked = (request.variant, request.costs, request.specialise)
    path = folder / f"{key_of(_version(), scene.key, *asked)}.json"

    def read(file: BinaryIO) -> Packed:
        found: Packed = _read(json.load(file), lambda told: _array(folder, told))
        os.utime(path)
        return found

    def write(file: BinaryIO, packed: Packed) -> None:
        arrays = list[Array]()
        _write(packed, arrays.append)
        told = iter(each([partial(_keep, folder, array) for array in arrays]))
        document = _write(packed, lambda _: next(told))
        file.write(json.dumps(document).encode())
        _make_room(folder)

    return kept(path, read, make, write)


@cache
def _version() -> str:
    here, digest = Path(__file__).parent, hashlib.sha256()
    for path in sorted(path for pattern in _SOURCES for path in here.glob(pattern)):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _write(value: Any, keep: Callable[[Array], Json | None]) -> Any:
    if is_dataclass(value):
        return {"kind": type(value).__name__} | {f.name: _write(getattr(value, f.name), keep) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return keep(value)
    return value.item() if isinstance(value, np.generic) else value


def _read(value: Any, find: Callable[[Json], Array]) -> Any:
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return find(value)
    return _KINDS[value["kind"]](**{name: _read(part, find) for name, part in value.items() if name != "kind"})


def _keep(folder: Path, array: Array) -> Json:
    data = np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
    digest = hashlib.sha256(data).hexdigest()
    path = folder / f"{digest}.bin"
    if path.exists():
        os.utime(path)
    else:
        write_whole(path, lambda file: file.write(data))
    return {"array": digest, "crc": zlib.crc32(data), "shape": array.shape, "type": array.dtype.str}


def _array(folder: Path, told: Json) -> Array:
    """A buffer, mapped copy on write; raise ValueError where it is not as it was written."""
    path = folder / f"{told['array']}.bin"
    data: Array = np.asarray(np.memmap(path, np.uint8, "c")) if path.stat().st_size else np.zeros(0, np.uint8)
    # A checksum finds damage as well as a digest does, in half of the time.
    if zlib.crc32(data.data) != told["crc"]:
        path.unlink()
        raise ValueError("The buffer is damaged.")
    os.utime(path)
    return data.view(told["type"]).reshape(told["shape"])


def _make_room(folder: Path) -> None:
    """Delete what was not used for longest, down to MOST_BYTES; what is mapped stays where it is mapped."""
    found = []
    for path in folder.iterdir():
        with suppress(OSError):
            told = path.stat()
            found.append((told.st_mtime, told.st_size, path))
    total = sum(size for _, size, _ in found)
    for _, size, path in sorted(found):
        if total <= MOST_BYTES:
            return
        path.unlink(missing_ok=True)
        total -= size
