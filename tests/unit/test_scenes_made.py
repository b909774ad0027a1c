"""Procedural scenes, smooth normals and the catalogue's list."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scenes import catalogue
from scenes.load import load
from scenes.normals import smooth_normals
from scenes.procedural import forest, statue
from scenes.scene import SceneError

MADE = [one for one in catalogue.ENTRIES.values() if one.made is not None]


@pytest.mark.parametrize("count", [4_000, 20_001, 174_000, 400_000])
def test_forest_has_the_count_that_was_asked(count: int) -> None:
    assert len(forest(count).faces) == count


def test_forest_is_called_a_stand_in_wherever_it_is_described() -> None:
    listed = {row["name"]: row for row in catalogue.list_scenes()}
    scene = load("forest")
    assert len(scene.faces) == listed["forest"]["triangles"] == 174_000
    for text in (scene.note, scene.source, listed["forest"]["title"], listed["forest"]["note"]):
        assert "procedural stand-in for Fairy Forest" in text


@pytest.mark.parametrize("name", [*(one.name for one in MADE), *(f"{one.name}:7000" for one in MADE if one.sized)])
def test_made_scenes_are_the_same_twice(name: str) -> None:
    assert load(name).key == load(name).key


def test_seeds_differ() -> None:
    assert not np.array_equal(forest(4_000, seed=1).vertices, forest(4_000, seed=2).vertices)
    assert not np.array_equal(statue(4_000, seed=1).vertices, statue(4_000, seed=2).vertices)


@pytest.mark.parametrize("count", [400, 555, 1_234, 17_389, 100_000, 1_000_000])
def test_statue_is_closed_and_near_its_count(count: int) -> None:
    mesh = statue(count)
    assert abs(len(mesh.faces) - count) <= 0.01 * count
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    # A torus has Euler characteristic 0.
    assert solid.euler_number == 0


@pytest.mark.parametrize("count", [500, 100_008, 1_000_000])
def test_statue_scene_stands_inside_the_box(count: int) -> None:
    scene = load(f"cornell-statue:{count}")
    assert abs(len(scene.faces) - count) <= 0.01 * count
    figure = scene.triangles[12:].reshape(-1, 3)
    assert (figure.min(axis=0) > [-0.99, 0.0, -1.04]).all()
    assert (figure.max(axis=0) < [1.0, 1.6, 0.99]).all()


@pytest.mark.parametrize("name", [one.name for one in MADE])
def test_a_made_scene_has_the_listed_count(name: str) -> None:
    assert len(load(name).faces) == catalogue.find(name).triangles


def test_smooth_normals_of_a_sphere_point_outwards() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices = np.asarray(ball.vertices, dtype=np.float32)
    normals = smooth_normals(vertices, np.asarray(ball.faces, dtype=np.int32))
    assert (np.sum(normals * vertices, axis=1) > 0.999).all()


def test_smooth_normals_stay_of_unit_length_on_degenerate_triangles() -> None:
    vertices = np.array([[0, 0, 0], [1e-4, 0, 0], [0, 1e-4, 0], [5, 5, 5], [6, 6, 6]], np.float32)
    normals = smooth_normals(vertices, np.array([[0, 1, 2], [0, 0, 1], [3, 3, 4]], np.int32))
    np.testing.assert_array_equal(normals, [[0, 0, 1]] * 3 + [[0, 1, 0]] * 2)


def test_list_without_any_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RAYFARM_SCENES", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    rows = catalogue.list_scenes()
    assert [row["name"] for row in rows if row["here"]] == [one.name for one in MADE]
    assert all(row["licence"] and row["source"] and row["get"] for row in rows)
    assert json.loads(json.dumps(rows)) == rows


def test_own_reconstruction_is_named_so() -> None:
    for row in catalogue.list_scenes():
        if row["name"] in ("happy-buddha", "cornell-buddha"):
            for key in ("source", "note"):
                assert catalogue.OWN_RECONSTRUCTION in row[key]


@pytest.mark.parametrize("name", ["crytek-sponza", "happy-buddha", "fairy-forest", "cornell-buddha-67k"])
def test_a_missing_scene_says_how_to_get_it(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RAYFARM_SCENES", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(SceneError, match=f"^{name} is not here: .*(fetch|RAYFARM_SCENES)"):
        load(name)
