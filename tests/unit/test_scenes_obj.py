"""OBJ text is normalised before trimesh sees it, and checked against an independent count."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scenes import cornell, obj
from scenes.load import load
from scenes.mesh import Mesh, read_mesh
from scenes.scene import SceneError

# A unit square in the way the Cornell files are written: tabs, CRLF, relative indices, two blocks.
TABBED = "v\t0 0 0\r\nv\t1 0 0\r\nv  1 1 0\r\nv\t0 1 0\r\nf -4 -3 -2 -1\r\n"
TABBED += "v\t0 0 5\r\nv\t2 0 5\r\nv  2 2 5\r\nf -3 -2 -1\r\n"


def area(mesh: Mesh) -> float:
    return obj.triangle_area(mesh.vertices, mesh.faces)


def write(folder: Path, text: str, name: str = "mesh.obj") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_tabs_and_relative_indices_are_read_whole(tmp_path: Path) -> None:
    mesh = read_mesh(write(tmp_path, TABBED))
    assert (len(mesh.vertices), len(mesh.faces)) == (7, 3)
    assert area(mesh) == pytest.approx(1.0 + 2.0)
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])


def test_trimesh_alone_still_misreads_it() -> None:
    """The reason for the normalisation; when this fails, trimesh was repaired."""
    try:
        raw = trimesh.load_scene(io.BytesIO(TABBED.encode()), file_type="obj", process=False)
        alone = float(raw.to_mesh().area)
    except (IndexError, ValueError):
        alone = 0.0
    assert alone != pytest.approx(3.0)


def test_a_loss_inside_trimesh_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    short = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]], process=False)
    monkeypatch.setattr("scenes.mesh._trimesh", lambda *_: short)
    with pytest.raises(SceneError, match=r"holds 7 vertices and 3 triangles of area 3, but was read as 3, 1 and"):
        read_mesh(write(tmp_path, TABBED))


def test_polygons_become_fans_and_drop_leaves_an_object_out(tmp_path: Path) -> None:
    text = "g keep\nv 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\ng gone\nf 1 2 3\no keep2\nf 3 4 5\n"
    path = write(tmp_path, text)
    np.testing.assert_array_equal(read_mesh(path).faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [2, 3, 4]])
    np.testing.assert_array_equal(read_mesh(path, drop=["gone"]).faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 3, 4]])


def test_normals_per_corner_split_their_vertex(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1//2 3//2 4//2\n"
    mesh = read_mesh(write(tmp_path, text))
    assert mesh.normals is not None
    corner_normals = mesh.normals[mesh.faces]
    np.testing.assert_array_equal(corner_normals[0], [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(corner_normals[1], [[1, 0, 0]] * 3)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces][1], [[0, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_faces_of_two_corners_are_nothing(tmp_path: Path) -> None:
    mesh = read_mesh(write(tmp_path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\nf 1 2 3\n"))
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])


def test_texture_corners_continuations_and_comments(tmp_path: Path) -> None:
    text = "# c\nvt 0 0\nv 0 0 0 # here\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1/1 \\\n2/1 3/1\n"
    mesh = read_mesh(write(tmp_path, text))
    assert mesh.normals is None
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2]])


def test_cornell_box_has_its_published_area() -> None:
    box, empty = cornell.original_box(), read_mesh(cornell.DATA / "cornell_empty.obj")
    assert (len(box.faces), len(empty.faces)) == (36, 12)
    assert area(box) == pytest.approx(26.5, abs=0.05)
    assert area(empty) == pytest.approx(20.4, abs=0.05)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "has no triangles"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no triangles"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "face index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "face index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\n", "face index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//2\n", "normal index out of range"),
        ("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or too large"),
        ("v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or too large"),
        ("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n", "NaN or too large"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "line 4, its last, has a face of fewer than three"),
        ("v 0 0 0\nv 1 0\n", "line 2 gives fewer than three coordinates"),
        ("v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "a coordinate that is not a number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 three\n", "line 4 has a face corner 'three'"),
    ],
)
def test_bad_obj_is_refused_in_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(SceneError, match=sentence) as caught:
        load(str(write(tmp_path, text)))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("mesh.obj")
