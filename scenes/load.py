"""From a catalogue name or a mesh file to a scene."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path

from scenes import catalogue, cornell, places
from scenes.entry import Entry, SourceFile
from scenes.kept_mesh import kept_mesh
from scenes.mesh import Mesh, read_mesh
from scenes.normals import smooth_normals
from scenes.scene import Camera, Scene, SceneError
from scenes.view import automatic_camera, automatic_light


def load(name_or_path: str, *, camera: Camera | None = None) -> Scene:
    """The scene of a catalogue name (`forest:N` for N triangles) or of any mesh file that trimesh reads.

    A relative path is looked up here, then in the folders of RAYFARM_SCENES and the user's cache. `camera`
    takes the place of the scene's own. SceneError, one sentence that says what to do, where the scene is
    unknown, is not here, or its file is missing, damaged or empty.
    """
    if name_or_path.partition(":")[0] in catalogue.ENTRIES:
        return load_entry(catalogue.find(name_or_path), camera=camera)
    path = _find_path(name_or_path)
    mesh = kept_mesh(path, None, "as it is", partial(read_mesh, path))
    return Scene(
        name=path.name,
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        camera=camera or automatic_camera(mesh.vertices, mesh.faces),
        lights=(automatic_light(mesh.vertices, mesh.faces),),
        source=f"the file {path.name}",
        note=mesh.note,
    )


def load_entry(entry: Entry, *, camera: Camera | None = None) -> Scene:
    """The scene of a catalogue entry; see `load`."""
    expected = entry.triangles - catalogue.BOX_TRIANGLES * entry.boxed
    mesh = _from_file(entry, expected) if entry.made is None else _finished(entry, entry.made(expected))
    lights = entry.lights or (automatic_light(mesh.vertices, mesh.faces),)
    return Scene(
        name=entry.name,
        vertices=mesh.vertices,
        faces=mesh.faces,
        normals=mesh.normals,
        camera=camera or entry.camera or automatic_camera(mesh.vertices, mesh.faces),
        lights=lights,
        source=entry.source,
        licence=entry.licence,
        note="; ".join(part for part in (entry.note, mesh.note) if part),
    )


def _find_path(text: str) -> Path:
    if "\0" in text or not text:
        raise SceneError("The scene's name is empty or has a NUL in it: give a catalogue name or a mesh file.")
    path = Path(text)
    if path.is_file():
        return path
    if path.is_dir():
        raise SceneError(f"{text!r} is a folder: give one mesh file in it.")
    found = None if path.is_absolute() else places.find_named(text)
    if found is not None:
        return found
    if path.suffix or os.sep in text:
        raise SceneError(f"There is no file {text!r} here or in the folders of {places.VARIABLE}: check the path.")
    raise SceneError(catalogue.unknown(text))


def _from_file(entry: Entry, expected: int) -> Mesh:
    found = places.find_source(entry, verified=True)
    if found is None:
        raise SceneError(_not_here(entry))
    path, file = found
    return kept_mesh(path, file.sha256, entry, lambda: _finished(entry, _read(entry, expected, path, file)))


def _read(entry: Entry, expected: int, path: Path, file: SourceFile) -> Mesh:
    mesh = read_mesh(path, entry.drop)
    # A checksum says more than a count.
    if file.sha256 is None and len(mesh.faces) != expected:
        raise SceneError(
            f"{path.name} has {len(mesh.faces):,} triangles, but {entry.name} has {expected:,}: delete it, then"
            f" {entry.get}."
        )
    return replace(mesh, vertices=cornell.place_buddha(mesh.vertices)) if entry.boxed else mesh


def _not_here(entry: Entry) -> str:
    wrong = places.find_source(entry)
    if wrong is None:
        return f"{entry.name} is not here: {entry.get}."
    return (
        f"{wrong[0].name} is not the file that {entry.name} means, its checksum differs: delete it, then"
        f" {entry.get}; or load it by its path."
    )


def _finished(entry: Entry, mesh: Mesh) -> Mesh:
    """The mesh in its box, where it has one, with the normals that the entry wants."""
    if entry.boxed:
        mesh = cornell.in_empty_box(mesh)
    if entry.normals == "smooth":
        return replace(mesh, normals=smooth_normals(mesh.vertices, mesh.faces))
    return mesh if entry.normals == "file" else replace(mesh, normals=None)
