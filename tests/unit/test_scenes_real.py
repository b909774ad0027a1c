"""The real scene files, where RAYFARM_SCENES says that they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes import catalogue, cornell, places
from scenes.entry import SourceFile
from scenes.load import load
from scenes.mesh import read_mesh
from scenes.scene import SceneError

REAL = [entry.name for entry in catalogue.ENTRIES.values() if not entry.made]
FILES = {file.name: file for entry in catalogue.ENTRIES.values() for file in entry.files[:1] if file.sha256}


def need(name: str) -> None:
    if not catalogue.is_here(catalogue.find(name)):
        pytest.skip(f"{name} is not in the folders of RAYFARM_SCENES")


@pytest.mark.parametrize("name", REAL)
def test_counts_are_the_catalogue_s(name: str) -> None:
    need(name)
    entry, scene = catalogue.find(name), load(name)
    assert len(scene.faces) == entry.triangles
    assert (scene.camera, scene.lights) == (entry.camera, entry.lights)
    assert (scene.name, scene.licence) == (name, entry.licence)
    assert (scene.normals is not None) == (entry.normals != "flat")
    if scene.normals is not None:
        lengths = np.linalg.norm(scene.normals.astype(np.float64), axis=1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)


@pytest.mark.parametrize("file", FILES.values(), ids=FILES)
def test_checksums(file: SourceFile) -> None:
    path = None if file.size else places.find_named(file.name)
    if path is None:
        pytest.skip(f"{file.name} is not in the folders of RAYFARM_SCENES")
    assert places.sha256(path) == file.sha256


def test_the_large_buddha_stands_in_the_box() -> None:
    need("cornell-buddha")
    scene = load("cornell-buddha")
    assert len(scene.faces) == 1_087_716 + 12
    assert "own reconstruction from Stanford's range scans, not Stanford's happy_vrip" in scene.note
    box = read_mesh(cornell.DATA / "cornell_empty.obj")
    np.testing.assert_array_equal(scene.triangles[:12], box.vertices[box.faces])
    figure = scene.triangles[12:].reshape(-1, 3)
    assert figure[:, 1].max() == pytest.approx(1.49, abs=0.01)
    # Stanford's base is not quite level: it may dip into the floor by millimetres.
    assert figure[:, 1].min() == pytest.approx(0.0, abs=0.005)
    assert (figure[:, [0, 2]] > box.vertices[:, [0, 2]].min(axis=0)).all()
    assert (figure[:, [0, 2]] < box.vertices[:, [0, 2]].max(axis=0)).all()


@pytest.mark.parametrize(("ours", "theirs"), [("box", "Original"), ("empty", "Empty-RG")])
def test_cornell_data_equal_the_archive(ours: str, theirs: str) -> None:
    published = places.find_named(f"cornell_obj/CornellBox-{theirs}.obj")
    if published is None:
        pytest.skip("cornell_obj is not in the folders of RAYFARM_SCENES")
    mesh, mine = read_mesh(published), read_mesh(cornell.DATA / f"cornell_{ours}.obj")
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], mine.vertices[mine.faces])


def test_another_file_under_the_catalogue_s_name_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = places.find_named("bunny_zipper_69k.ply")
    if source is None:
        pytest.skip("bunny_zipper_69k.ply is not in the folders of RAYFARM_SCENES")
    data = source.read_bytes()
    (tmp_path / source.name).write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    monkeypatch.setenv("RAYFARM_SCENES", str(tmp_path))
    with pytest.raises(SceneError, match="checksum differs: delete it, then run rayfarm scenes fetch"):
        load("stanford-bunny")
