"""PLY, STL, OFF and GLB files, whole and damaged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from scenes import mesh as mesh_module
from scenes.load import load
from scenes.mesh import read_mesh
from scenes.scene import Camera, SceneError

HEADER = "ply\nformat {kind} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n"
HEADER += "{extra}element face {m}\nproperty list uchar int vertex_indices\nend_header\n"
NORMAL = "property float nx\nproperty float ny\nproperty float nz\n"
SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]


def ply_bytes(vertices: Any, faces: list[list[int]], normals: Any = None, ascii_text: bool = False) -> bytes:
    rows = np.asarray(vertices, dtype="<f4").reshape(-1, 3)
    if normals is not None:
        rows = np.hstack([rows, np.asarray(normals, dtype="<f4")])
    kind = "ascii" if ascii_text else "binary_little_endian"
    extra = NORMAL if normals is not None else ""
    head = HEADER.format(kind=kind, n=len(rows), m=len(faces), extra=extra).encode()
    if ascii_text:
        lines = [" ".join(map(repr, row.tolist())) for row in rows]
        lines += [" ".join(map(str, [len(face), *face])) for face in faces]
        return head + ("\n".join(lines) + "\n").encode()
    body = b"".join(bytes([len(face)]) + np.array(face, dtype="<i4").tobytes() for face in faces)
    return head + rows.tobytes() + body


def export(geometry: Any, kind: str) -> bytes:
    data = geometry.export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)


def save(folder: Path, name: str, data: bytes) -> str:
    (folder / name).write_bytes(data)
    return str(folder / name)


@pytest.mark.parametrize("ascii_text", [False, True])
def test_ply_keeps_order_degenerates_and_duplicates(tmp_path: Path, ascii_text: bool) -> None:
    faces = [[2, 1, 0], [0, 0, 1], [2, 1, 0], [3, 2, 0]]
    data = ply_bytes([*SQUARE, (9, 9, 9)], faces, ascii_text=ascii_text)
    scene = load(save(tmp_path, "a.ply", data))
    np.testing.assert_array_equal(scene.faces, faces)
    np.testing.assert_array_equal(scene.vertices, [*SQUARE, (9, 9, 9)])
    assert (scene.vertices.dtype.name, scene.faces.dtype.name) == ("float32", "int32")
    assert scene.normals is None
    # The automatic camera looks at what is used, not at the stray vertex.
    assert scene.camera.target == pytest.approx((0.5, 0.5, 0.0))


@pytest.mark.parametrize("ascii_text", [False, True])
def test_ply_quads_become_fans(tmp_path: Path, ascii_text: bool) -> None:
    scene = load(save(tmp_path, "q.ply", ply_bytes(SQUARE, [[0, 1, 2, 3]], ascii_text=ascii_text)))
    assert sorted(map(sorted, scene.faces.tolist())) == [[0, 1, 2], [0, 2, 3]]


def test_mixed_polygons_in_an_ascii_ply(tmp_path: Path) -> None:
    faces = [[0, 1, 2, 3], [0, 1, 2], [4, 3, 2, 1, 0]]
    scene = load(save(tmp_path, "m.ply", ply_bytes([*SQUARE, (-1, 0.5, 0)], faces, ascii_text=True)))
    assert len(scene.faces) == 2 + 1 + 3


def test_normals_come_from_the_file_or_not_at_all(tmp_path: Path) -> None:
    normals = np.tile([0.0, 0.0, 1.0001], (4, 1))
    scene = load(save(tmp_path, "n.ply", ply_bytes(SQUARE, [[0, 1, 2], [0, 2, 3]], normals)))
    assert scene.normals is not None
    np.testing.assert_array_equal(scene.normals, np.tile([0.0, 0.0, 1.0], (4, 1)))


@pytest.mark.parametrize("bad", [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [np.nan, 0.0, 1.0]])
def test_nonsense_normals_are_left_out_with_a_note(tmp_path: Path, bad: list[float]) -> None:
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    normals[2] = bad
    scene = load(save(tmp_path, "n.ply", ply_bytes(SQUARE, [[0, 1, 2], [0, 2, 3]], normals)))
    assert scene.normals is None
    assert "normals" in scene.note


def test_scene_graph_is_flattened_with_its_transforms(tmp_path: Path) -> None:
    graph = trimesh.Scene()
    shift = np.eye(4)
    shift[0, 3] = 5.0
    graph.add_geometry(trimesh.creation.box())
    graph.add_geometry(trimesh.creation.box(), transform=shift)
    path = tmp_path / "two.glb"
    path.write_bytes(export(graph, "glb"))
    scene = load(str(path))
    assert len(scene.faces) == 24
    np.testing.assert_allclose(scene.bounds, [[-0.5, -0.5, -0.5], [5.5, 0.5, 0.5]])


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "off"])
def test_other_formats_whole_and_cut(tmp_path: Path, kind: str) -> None:
    data = export(trimesh.creation.icosphere(subdivisions=1), kind)
    name = "ball." + kind.partition("_")[0]
    assert len(load(save(tmp_path, name, data)).faces) == 80
    for keep in (len(data) // 2, len(data) - 40):
        with pytest.raises(SceneError, match="truncated"):
            load(save(tmp_path, name, data[:keep]))


@pytest.mark.parametrize("ascii_text", [False, True])
@pytest.mark.parametrize("cut", [1, 14, 60, 250])
def test_truncated_ply(tmp_path: Path, ascii_text: bool, cut: int) -> None:
    data = ply_bytes(SQUARE, [[0, 1, 2], [0, 2, 3]], ascii_text=ascii_text)
    # Without its last line feed or digit an ASCII file may still be whole, so a whole token goes.
    with pytest.raises(SceneError, match=r"truncated|damaged"):
        load(save(tmp_path, "cut.ply", data[: len(data) - cut - 2 * ascii_text]))


TRIANGLE = [[0, 1, 2]]
NOT_A_NUMBER = [(0, 0, 0), (float("nan"), 0, 0), (0, 1, 0)]
BAD_FILES = {
    "empty.ply": (b"", "no whole PLY header"),
    "nofaces.ply": (ply_bytes(SQUARE, []), "has no triangles"),
    "nan.ply": (ply_bytes(NOT_A_NUMBER, TRIANGLE), "NaN or too large"),
    "nan_ascii.ply": (ply_bytes(NOT_A_NUMBER, TRIANGLE, ascii_text=True), "NaN or too large"),
    "high.ply": (ply_bytes(SQUARE, [[0, 1, 4]]), "face index out of range"),
    "negative.ply": (ply_bytes(SQUARE, [[0, 1, -1]]), "face index out of range"),
    "uneven.ply": (ply_bytes(SQUARE, [[0, 1, 2], [0, 1, 2, 3]]), "cannot be read"),
    # The same length as three triangles, so only the lists' own lengths tell.
    "balanced.ply": (ply_bytes(SQUARE, [[0, 1, 2], [0, 1], [0, 1, 2, 3]]), "cannot be read|was read|were read"),
    "header.ply": (b"ply\nformat ascii 1.0\nelement vertex lots\nend_header\n", "damaged PLY header"),
    "huge.ply": (ply_bytes(SQUARE, TRIANGLE).replace(b"face 1", b"face 99999999"), "simplify it to at most"),
    "words.stl": (b"hello", "truncated or damaged"),
    "words.glb": (b"hello", "cannot be read"),
    "words.off": (b"hello", "damaged or truncated"),
    "notes.txt": (b"hello", "is not a mesh file that can be read"),
    "packed.zip": (b"PK", "is an archive"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files_are_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    data, sentence = BAD_FILES[name]
    with pytest.raises(SceneError, match=sentence) as caught:
        load(save(tmp_path, name, data))
    assert "\n" not in str(caught.value)
    assert str(tmp_path) not in str(caught.value)


def test_a_limit_on_triangles_after_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_module, "MAX_TRIANGLES", 11)
    path = tmp_path / "box.glb"
    path.write_bytes(export(trimesh.creation.box(), "glb"))
    with pytest.raises(SceneError, match="12 triangles: simplify"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("", "empty or has a NUL"),
        ("a\0b", "empty or has a NUL"),
        ("none.ply", r"There is no file 'none\.ply'"),
        ("sponza", "did you mean .*sponza"),
        ("qqqqqq", "There is no scene 'qqqqqq': choose one of cornell-box"),
        ("<script>alert(1)</script>", "There is no"),
        ("conference:5", "fixed triangle count"),
        ("forest:", "needs a whole number"),
        ("forest:-5", "needs a whole number"),
        ("forest:²", "needs a whole number"),
        ("forest:3", "ask for 4,000 to"),
        ("cornell-statue:99999999", "ask for 400 to 1,000,000"),
    ],
)
def test_bad_names(name: str, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence) as caught:
        load(name)
    assert "\n" not in str(caught.value)


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="is a folder"):
        load(str(tmp_path))


def test_a_camera_can_be_given_and_files_are_found_in_the_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path, "square.ply", ply_bytes(SQUARE, [[0, 1, 2]]))
    monkeypatch.setenv("RAYFARM_SCENES", str(tmp_path))
    camera = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), 30.0)
    scene = load("square.ply", camera=camera)
    assert scene.camera == camera
    assert len(scene.faces) == 1
