"""Meshes come back from disk as they were read, and never those of another file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scenes import catalogue, kept_mesh, places
from scenes.kept import cache_folder
from scenes.load import load
from scenes.scene import Scene

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 {z}\nvn 0 0 1\nf 1//1 2//1 3//1\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path / "cache"))
    return cache_folder("meshes")


def write(folder: Path, z: str = "0") -> str:
    path = folder / "one.obj"
    path.write_text(OBJ.format(z=z))
    return str(path)


def assert_same(first: Scene, second: Scene) -> None:
    for name in ("vertices", "faces", "normals"):
        mine, other = getattr(first, name), getattr(second, name)
        np.testing.assert_array_equal(mine, other)
        assert mine is None or mine.dtype == other.dtype
    assert (first.key, first.note, first.camera, first.lights) == (
        second.key,
        second.note,
        second.camera,
        second.lights,
    )


def test_a_file_is_read_once(tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path)
    first = load(path)
    assert first.normals is not None
    assert len(list(cache.iterdir())) == 1
    monkeypatch.setattr("scenes.load.read_mesh", lambda *_: pytest.fail("read again"))
    assert_same(first, load(path))


def test_other_content_under_the_same_name_is_read(tmp_path: Path, cache: Path) -> None:
    assert load(write(tmp_path)).vertices[2, 2] == 0.0
    assert load(write(tmp_path, "5")).vertices[2, 2] == 5.0
    assert len(list(cache.iterdir())) == 2


def test_a_damaged_entry_is_read_again(tmp_path: Path, cache: Path) -> None:
    path = write(tmp_path)
    first = load(path)
    (entry,) = cache.iterdir()
    entry.write_bytes(entry.read_bytes()[:-40])
    assert_same(first, load(path))


def test_a_catalogue_scene_comes_back_smoothed_and_in_its_box(cache: Path) -> None:
    if places.find_source(catalogue.find("cornell-buddha")) is None:
        pytest.skip("cornell-buddha is not in the folders of RAYFARM_SCENES")
    first = load("cornell-buddha")
    assert len(list(cache.iterdir())) == 1
    assert first.normals is None or len(first.normals) == len(first.vertices)
    assert_same(first, load("cornell-buddha"))


def test_what_names_other_files_is_not_kept(tmp_path: Path, cache: Path) -> None:
    path = tmp_path / "one.gltf"
    path.write_text("{}")
    made: list[int] = []
    for _ in range(2):
        kept_mesh.kept_mesh(path, None, "as it is", lambda: made.append(1))  # type: ignore[arg-type, return-value]
    assert len(made) == 2
    assert not cache.exists()


def test_a_round_with_all_at_hand_imports_no_compiler_and_no_reader() -> None:
    code = "import sys, renderer.slice; print(sorted({'numba', 'trimesh', 'embreex', 'PIL'} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("points", [1, 3, 1024, 1025, 5000])
def test_bounds_are_those_of_all_corners(points: int) -> None:
    rng = np.random.default_rng(points)
    vertices = rng.normal(size=(points, 3)).astype(np.float32)
    faces = rng.integers(0, points, (points, 3)).astype(np.int32)
    scene = load("cornell-box")
    made = Scene("made", vertices, faces, None, scene.camera, scene.lights)
    np.testing.assert_array_equal(made.bounds[0], vertices[faces].min(axis=(0, 1)))
    np.testing.assert_array_equal(made.bounds[1], vertices[faces].max(axis=(0, 1)))
