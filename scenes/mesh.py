"""Reads any mesh file that trimesh reads into plain arrays, and refuses what is wrong in one sentence."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenes import counts, obj
from scenes.limits import bounded_memory, require_small_archive
from scenes.scene import Floats, Ints, SceneError

MAX_TRIANGLES = 1 << 24
ARCHIVES = ("zip", "gz", "bz2", "xz", "7z", "rar", "tar", "tgz")
PACKED = ("3mf", "zae")
AREA_TOLERANCE = 1e-6
# A unit normal survives six printed decimals, or a half-float, to better than this.
UNIT_TOLERANCE = 0.05


@dataclass(frozen=True, eq=False)
class Mesh:
    """`vertices` (n, 3) float32, `faces` (m, 3) int32, unit `normals` (n, 3) float32 or None, and a remark."""

    vertices: Floats
    faces: Ints
    normals: Floats | None = None
    note: str = ""


def read_mesh(path: Path, drop: Iterable[str] = ()) -> Mesh:
    """Read a mesh file, flattening a scene graph; faces and vertices keep the file's order.

    Degenerate and duplicate triangles stay. `drop` names OBJ objects to leave out. SceneError where the file
    is missing, truncated, unreadable, empty or absurdly large, or has NaN vertices or bad indices.
    """
    if not path.is_file():
        raise SceneError(f"There is no file {str(path)!r}: check the path.")
    try:
        with bounded_memory():
            return _checked(_load(path, drop), path.name)
    except MemoryError:
        raise SceneError(f"{path.name} takes more memory to read than there is: simplify it.") from None


def _load(path: Path, drop: Iterable[str]) -> Any:
    kind = path.suffix.lower().lstrip(".")
    if kind == "obj":
        return _read_obj(path, drop)
    if kind == "ply":
        return _read_ply(path)
    if kind in PACKED:
        require_small_archive(path)
    return _read_other(path, kind)


def _read_obj(path: Path, drop: Iterable[str]) -> Any:
    plain = obj.normalise(path.read_text(encoding="utf-8", errors="replace"), path.name, drop)
    _check_count(plain.triangles, path.name)
    mesh = _trimesh(io.BytesIO(plain.text.encode()), "obj", path.name)
    area = obj.triangle_area(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    same_area = not np.isfinite(plain.area) or np.isclose(area, plain.area, rtol=AREA_TOLERANCE, atol=0.0)
    if (len(mesh.vertices), len(mesh.faces)) != (plain.vertices, plain.triangles) or not same_area:
        raise SceneError(
            f"{path.name} holds {plain.vertices:,} vertices and {plain.triangles:,} triangles of area"
            f" {plain.area:.6g}, but was read as {len(mesh.vertices):,}, {len(mesh.faces):,} and {area:.6g}:"
            " convert it to PLY."
        )
    return mesh


def _read_ply(path: Path) -> Any:
    header = counts.read_ply_header(path)
    _check_count(header.faces, path.name)
    counts.check_ply_length(path, header)
    mesh = _trimesh(path, "ply", path.name)
    rows, triangles = _ply_polygons(mesh)
    if (len(mesh.vertices), rows) != (header.vertices, header.faces) or len(mesh.faces) != triangles:
        raise SceneError(
            f"{path.name} promises {header.vertices:,} vertices and {header.faces:,} faces, but"
            f" {len(mesh.vertices):,} and {rows:,} were read: it is truncated or damaged, get it again."
        )
    return mesh


def _ply_polygons(mesh: Any) -> tuple[int, int]:
    """The rows of a PLY file's face element, and its triangles after fan triangulation."""
    data = mesh.metadata["_ply_raw"]["face"]["data"]
    if isinstance(data, np.ndarray):
        lists = [name for name in data.dtype.names or () if data.dtype[name].names]
    else:
        lists = list(data)
    name = next((n for n in lists if n in ("vertex_index", "vertex_indices")), lists[0])
    # A binary list is read with the first row's length, so the rows' own lengths are the check.
    sizes = data[name]["f0"] if isinstance(data, np.ndarray) else [len(polygon) for polygon in data[name]]
    lengths = np.asarray(sizes, dtype=np.int64)
    return len(lengths), int(np.maximum(lengths - 2, 0).sum())


def _read_other(path: Path, kind: str) -> Any:
    expected = {"off": counts.off_triangles, "stl": counts.stl_triangles}.get(kind)
    triangles = expected(path) if expected else None
    if triangles is not None:
        _check_count(triangles, path.name)
    mesh = _trimesh(path, kind, path.name)
    if triangles is not None and len(mesh.faces) != triangles:
        raise SceneError(
            f"{path.name} holds {triangles:,} triangles, but {len(mesh.faces):,} were read: convert it to PLY."
        )
    return mesh


def _trimesh(source: Path | io.BytesIO, kind: str, name: str) -> Any:
    # Meshes mostly come from `scenes.kept_mesh`, which does without it.
    import trimesh

    if kind in ARCHIVES:
        raise SceneError(f"{name} is an archive: unpack it and give the mesh file inside.")
    if kind not in trimesh.available_formats():
        raise SceneError(f"{name} is not a mesh file that can be read: use PLY, OBJ, STL, OFF or GLB.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = trimesh.load(source, file_type=kind, process=False, maintain_order=True, skip_materials=True)
            mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) and loaded.geometry else loaded
    except MemoryError:
        raise
    # trimesh's readers raise whatever their parsing stumbles over.
    except Exception as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise SceneError(f"{name} cannot be read ({reason}): it is damaged, or convert it to PLY.") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise SceneError(f"{name} has no triangles: choose a file with a surface mesh.")
    return mesh


def _checked(mesh: Any, name: str) -> Mesh:
    faces, original = np.asarray(mesh.faces), np.asarray(mesh.vertices, dtype=np.float64)
    _check_count(len(faces), name)
    if faces.min() < 0 or faces.max() >= len(original):
        raise SceneError(f"{name} has a face index out of range: repair the mesh and export it again.")
    with np.errstate(over="ignore"):
        vertices = np.ascontiguousarray(original, dtype=np.float32)
    if not np.isfinite(vertices).all():
        raise SceneError(f"{name} has vertices that are NaN or too large for 32 bits: repair the mesh.")
    # trimesh makes normals up when asked for them; only those that it was given are in its cache by now.
    given = mesh._cache.cache.get("vertex_normals")
    normals = None if given is None else _unit(given, len(vertices))
    note = "The file's normals are not of unit length and are left out." if given is not None else ""
    return Mesh(vertices, np.ascontiguousarray(faces, dtype=np.int32), normals, "" if normals is not None else note)


def _unit(given: Any, count: int) -> Floats | None:
    normals = np.asarray(given, dtype=np.float64)
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(normals, axis=1) if normals.shape == (count, 3) else np.zeros(0)
        sound = len(lengths) == count and bool((np.abs(lengths - 1.0) <= UNIT_TOLERANCE).all())
    return (normals / lengths[:, None]).astype(np.float32) if sound else None


def _check_count(triangles: int, name: str) -> None:
    if triangles == 0:
        raise SceneError(f"{name} has no triangles: choose a file with a surface mesh.")
    if triangles > MAX_TRIANGLES:
        raise SceneError(f"{name} has {triangles:,} triangles: simplify it to at most {MAX_TRIANGLES:,}.")
