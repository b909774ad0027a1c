"""Meshes as they were read and smoothed, which takes long, kept on disk by the content of their files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scenes.kept import cache_folder, kept, key_of
from scenes.kept_arrays import map_arrays, write_arrays
from scenes.mesh import Mesh
from scenes.places import sha256

VERSION = 1
"""Part of every key: raise it with any change to what a reader returns, trimesh's readers included."""

ALONE = (".ply", ".obj", ".stl", ".off")
"""Formats whose geometry lies in one file."""


def kept_mesh(path: Path, digest: str | None, made_by: object, make: Callable[[], Mesh]) -> Mesh:
    """What `make` gives of the file at `path`, or gave when it last was asked to.

    `digest` is the file's sha256 where it is known; `made_by` tells by its `repr` what else the mesh is made from.
    Formats that may name other files are made anew.
    """
    if path.suffix.lower() not in ALONE or not path.is_file():
        return make()
    key = key_of(VERSION, path.suffix.lower(), digest or sha256(path), made_by)
    return kept(cache_folder("meshes") / f"{key}.npz", _read, make, _write)


def _read(file: BinaryIO) -> Mesh:
    entry = map_arrays(file)
    return Mesh(entry["vertices"], entry["faces"], entry.get("normals"), str(entry["note"]))


def _write(file: BinaryIO, mesh: Mesh) -> None:
    fields: dict[str, Any] = {"vertices": mesh.vertices, "faces": mesh.faces, "note": np.array(mesh.note)}
    if mesh.normals is not None:
        fields["normals"] = mesh.normals
    write_arrays(file, fields)
