"""What a mesh file says that it holds, read without the loader, to check what the loader made of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from scenes.scene import SceneError

SIZES = {
    name: size
    for size, names in {
        1: ("char", "uchar", "int8", "uint8"),
        2: ("short", "ushort", "int16", "uint16"),
        4: ("int", "uint", "int32", "uint32", "float", "float32"),
        8: ("double", "float64"),
    }.items()
    for name in names
}
HEADER_LIMIT = 1 << 16


@dataclass(frozen=True)
class PlyHeader:
    """Elements of a PLY file, and the fewest bytes or lines that its body can have when faces are triangles.

    `face_row` is the body's line on which an ASCII file's faces start, if their rows start with the corners.
    """

    binary: bool
    vertices: int
    faces: int
    body_start: int
    least_body: int
    face_row: int | None


def read_ply_header(path: Path) -> PlyHeader:
    """Read the header of a PLY file; SceneError where it has none or it is damaged."""
    with path.open("rb") as file:
        head = file.read(HEADER_LIMIT)
    end = head.find(b"end_header")
    body = head.find(b"\n", end) + 1
    if not head.startswith(b"ply") or end < 0 or body == 0:
        raise SceneError(f"{path.name} has no whole PLY header: the file is truncated or not a PLY file.")
    try:
        return _parse_header(head[:end].decode("ascii", "replace").splitlines(), body)
    except (ValueError, KeyError, IndexError):
        raise SceneError(f"{path.name} has a damaged PLY header: export the mesh again.") from None


def _parse_header(lines: list[str], body_start: int) -> PlyHeader:
    binary = False
    counts: dict[str, int] = {}
    strides: dict[str, int] = {}
    first: dict[str, str] = {}
    element = ""
    for words in (line.split() for line in lines if line.strip()):
        if words[0] == "format":
            binary = words[1].startswith("binary")
        elif words[0] == "element":
            element = words[1]
            counts[element], strides[element] = int(words[2]), 0
        elif words[0] == "property":
            first.setdefault(element, words[1])
            strides[element] += _property_bytes(words, element)
    if min(counts.values(), default=0) < 0:
        raise ValueError("negative count")
    least = sum(count * (strides[name] if binary else 1) for name, count in counts.items())
    names = list(counts)
    leads = first.get("face") == "list"
    face_row = sum(counts[name] for name in names[: names.index("face")]) if leads else None
    return PlyHeader(binary, counts.get("vertex", 0), counts.get("face", 0), body_start, least, face_row)


def _property_bytes(words: list[str], element: str) -> int:
    """The fewest bytes of one property: a face's list holds a triangle, any other list may be empty."""
    if words[1] == "list":
        return SIZES[words[2]] + 3 * SIZES[words[3]] * (element == "face")
    return SIZES[words[1]]


def check_ply_length(path: Path, header: PlyHeader) -> None:
    """SceneError where the body of the file is shorter than its header promises."""
    rows: list[bytes] = []
    if header.binary:
        found, unit = path.stat().st_size - header.body_start, "bytes"
    else:
        rows = [row for row in path.read_bytes()[header.body_start :].splitlines() if row.strip()]
        found, unit = len(rows), "lines"
    if found < header.least_body:
        raise SceneError(
            f"{path.name} is truncated: its header promises at least {header.least_body:,} {unit} of data"
            f" and {found:,} are there; get the file again."
        )
    if rows and header.face_row is not None:
        _check_ply_rows(path, rows[header.face_row : header.face_row + header.faces])


def _check_ply_rows(path: Path, rows: list[bytes]) -> None:
    """trimesh shortens a row that ends early, so each is held against the length that it starts with."""
    for number, words in enumerate((row.split() for row in rows), start=1):
        if not words[0].isdigit() or len(words) <= int(words[0]):
            raise SceneError(f"{path.name} is truncated or damaged: face {number:,} ends early; get it again.")


def off_triangles(path: Path) -> int:
    """The triangles of an OFF file, polygons counted as fans; SceneError where lines are missing."""
    words = [line.partition("#")[0].split() for line in path.read_text(errors="replace").splitlines()]
    rows = [row for row in words if row]
    try:
        if rows[0][0].upper().endswith("OFF"):
            rows[0] = rows[0][1:]
        rows = [row for row in rows if row]
        vertices, faces = int(rows[0][0]), int(rows[0][1])
        if vertices < 0 or faces < 0:
            raise ValueError("negative count")
        polygons = rows[1 + vertices : 1 + vertices + faces]
        whole = len(polygons) == faces and all(len(row) > int(row[0]) for row in polygons)
        if not whole:
            raise SceneError(f"{path.name} is truncated: it has fewer faces than its {faces:,}; get it again.")
        return sum(max(int(row[0]) - 2, 0) for row in polygons)
    except (ValueError, IndexError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{path.name} is damaged or truncated: export the mesh again.") from None


def stl_triangles(path: Path) -> int:
    """The triangles of an STL file, binary or ASCII; SceneError where the file is cut off."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(84)
    promised = int.from_bytes(head[80:84], "little")
    if len(head) == 84 and size == 84 + 50 * promised:
        return promised
    if not head.lstrip().lower().startswith(b"solid"):
        raise SceneError(f"{path.name} is truncated or damaged: its header does not fit its length; get it again.")
    text = path.read_bytes().lower()
    opened, closed = text.count(b"outer loop"), text.count(b"endfacet")
    if opened != closed or b"endsolid" not in text:
        raise SceneError(f"{path.name} is truncated: it ends in the middle of a solid; get it again.")
    return closed
