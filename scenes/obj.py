"""Wavefront OBJ text made plain, with an independent count of what it holds.

trimesh reads only `v` lines whose numbers follow one space, resolves relative indices against the whole file
and keeps one normal a vertex. The Cornell box of the McGuire archive has tabs and relative indices and comes
back with 6.9 of its 26.5 units of area, without a warning. So the text is brought to absolute indices, single
spaces, triangles and one normal a vertex before trimesh sees it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from scenes.scene import SceneError

Corner = tuple[int, int]
NO_NORMAL = -1


@dataclass(frozen=True)
class PlainObj:
    """Normalised OBJ text, and its vertices, triangles and area (scene units squared) counted from the source."""

    text: str
    vertices: int
    triangles: int
    area: float


@dataclass
class _Source:
    positions: list[list[str]] = field(default_factory=list)
    normals: list[list[str]] = field(default_factory=list)
    polygons: list[list[Corner]] = field(default_factory=list)


def normalise(text: str, name: str, drop: Iterable[str] = ()) -> PlainObj:
    """Bring OBJ `text` to the form that trimesh reads without loss, leaving out the objects named in `drop`.

    Polygons become fans in file order. SceneError where a line is malformed or an index is out of range.
    """
    source = _parse(text, name, frozenset(drop))
    triangles = [(p[0], p[i], p[i + 1]) for p in source.polygons for i in range(1, len(p) - 1)]
    _check_range(triangles, source, name)
    has_normals = bool(triangles) and all(n != NO_NORMAL for p in source.polygons for _, n in p)
    corners = np.array(triangles, dtype=np.int64).reshape(-1, 3, 2)
    plain = _with_normals(source, corners) if has_normals else _without_normals(source, corners)
    vertices = sum(1 for line in plain if line.startswith("v "))
    return PlainObj("\n".join(plain) + "\n", vertices, len(triangles), _area(source, corners, name))


def _parse(text: str, name: str, drop: frozenset[str]) -> _Source:
    source = _Source()
    dropping = False
    number, words = 0, [""]
    for number, words in _lines(text):
        match words[0]:
            case "v":
                source.positions.append(_three(words, number, name))
            case "vn":
                source.normals.append(_three(words, number, name))
            case "o" | "g":
                dropping = not drop.isdisjoint(words[1:])
            case "f" if not dropping:
                source.polygons.append([_corner(word, source, number, name) for word in words[1:]])
    # Old files have faces of two corners, which are nothing; at the very end it is a file cut off.
    if words[0] == "f" and len(words) < 4:
        raise SceneError(f"{name} is truncated: line {number}, its last, has a face of fewer than three corners.")
    return source


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    if "\\" in text:
        text = text.replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def _three(words: list[str], number: int, name: str) -> list[str]:
    if len(words) < 4:
        raise SceneError(f"{name} is damaged or truncated: line {number} gives fewer than three coordinates.")
    return words[1:4]


def _corner(word: str, source: _Source, number: int, name: str) -> Corner:
    """The absolute, zero-based vertex and normal of `v`, `v/vt`, `v//vn` or `v/vt/vn`."""
    parts = word.split("/")
    try:
        vertex = _absolute(int(parts[0]), len(source.positions))
        has_normal = len(parts) > 2 and parts[2]
        return vertex, _absolute(int(parts[2]), len(source.normals)) if has_normal else NO_NORMAL
    except ValueError:
        raise SceneError(f"{name} is damaged: line {number} has a face corner {word!r}.") from None


def _absolute(index: int, count: int) -> int:
    """OBJ counts from 1, and negative indices count back from the newest element; -2 stands for neither."""
    if index > 0:
        return index - 1
    return count + index if -count <= index < 0 else -2


def _check_range(triangles: list[tuple[Corner, Corner, Corner]], source: _Source, name: str) -> None:
    if not triangles:
        return
    corners = np.array(triangles, dtype=np.int64).reshape(-1, 2)
    vertex, normal = corners[:, 0], corners[:, 1]
    if vertex.min() < 0 or vertex.max() >= len(source.positions):
        raise SceneError(f"{name} has a face index out of range: repair the mesh and export it again.")
    if normal.min() < NO_NORMAL or normal.max() >= len(source.normals):
        raise SceneError(f"{name} has a normal index out of range: repair the mesh and export it again.")


def _without_normals(source: _Source, corners: np.ndarray) -> list[str]:
    lines = ["v " + " ".join(position) for position in source.positions]
    lines += [f"f {a} {b} {c}" for a, b, c in (corners[:, :, 0] + 1).tolist()]
    return lines


def _with_normals(source: _Source, corners: np.ndarray) -> list[str]:
    """A vertex that is used with several normals becomes several vertices."""
    pairs, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    lines = ["v " + " ".join(source.positions[vertex]) for vertex in pairs[:, 0].tolist()]
    lines += ["vn " + " ".join(source.normals[normal]) for normal in pairs[:, 1].tolist()]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in (index.reshape(-1, 3) + 1).tolist()]
    return lines


def _area(source: _Source, corners: np.ndarray, name: str) -> float:
    try:
        positions = np.array(source.positions, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise SceneError(f"{name} is damaged: a vertex has a coordinate that is not a number.") from None
    return triangle_area(positions, corners[:, :, 0])


def triangle_area(positions: np.ndarray, faces: np.ndarray) -> float:
    """The summed area of `faces` (m, 3) over `positions` (n, 3) in scene units squared, in float64."""
    a, b, c = (positions[faces[:, k]].astype(np.float64) for k in range(3))
    with np.errstate(all="ignore"):
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
