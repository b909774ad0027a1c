"""Mesh files that would take far more than they look like: refused in a sentence, in little memory."""

from __future__ import annotations

import json
import resource
import struct
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from scenes import mesh
from scenes.limits import bounded_memory, require_small_archive
from scenes.mesh import read_mesh
from scenes.scene import SceneError

HUGE = 10**10


def write_glb(path: Path, count: int) -> None:
    """A triangle whose accessors have no data: the format then means `count` zeros."""
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 4}],
        "accessors": [
            {"componentType": 5126, "count": count, "type": "VEC3"},
            {"componentType": 5125, "count": count, "type": "SCALAR"},
        ],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", 4, 0x004E4942) + bytes(4)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk)


def test_a_mesh_that_takes_100_gb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parse, parsed = mesh._trimesh, []

    def recorded(source: Any, kind: str, name: str) -> Any:
        parsed.append(kind)
        return parse(source, kind, name)

    monkeypatch.setattr(mesh, "_trimesh", recorded)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {HUGE}\nproperty float x\nproperty float y\n"
    face = f"property float z\nelement face {HUGE}\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "huge.ply").write_bytes((head + face).encode() + bytes(64))
    few = face.replace(f"face {HUGE}", "face 1")
    (tmp_path / "vertices.ply").write_bytes((head + few).encode() + bytes(64))
    (tmp_path / "huge.off").write_text(f"OFF\n{HUGE} {HUGE} 0\n0 0 0\n")
    (tmp_path / "huge.stl").write_bytes(bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50))
    write_glb(tmp_path / "huge.glb", HUGE)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(SceneError) as refused:
            read_mesh(path)
        assert str(refused.value).endswith("."), path
    assert parsed == ["glb"]  # The others' own counts cannot be true, so no parser sees them.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000  # KiB
    assert resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY


def test_a_mesh_is_read_in_bounded_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_glb(tmp_path / "large.glb", 30_000_000)
    monkeypatch.setattr(mesh, "bounded_memory", partial(bounded_memory, 64 << 20))
    with pytest.raises(SceneError, match="takes more memory to read than there is"):
        read_mesh(tmp_path / "large.glb")


def test_memory_is_bounded_and_given_back() -> None:
    with pytest.raises(MemoryError), bounded_memory(64 << 20):
        bytearray(256 << 20)
    assert len(bytearray(256 << 20)) == 256 << 20


@pytest.mark.parametrize("lies", [False, True])
def test_a_zip_bomb_is_refused(tmp_path: Path, lies: bool) -> None:
    path = tmp_path / "bomb.3mf"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("3D/3dmodel.model", "w", force_zip64=True) as content,
    ):
        for _ in range(1200):
            content.write(bytes(1 << 20))
    assert path.stat().st_size < 3 << 20
    if lies:
        data = path.read_bytes()
        path.write_bytes(data.replace(struct.pack("<I", 1200 << 20), struct.pack("<I", 100)))
    with pytest.raises(SceneError, match=r"unpacks to more than 1024 MiB|damaged"):
        read_mesh(path)


def test_an_archive_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "none.3mf"
    path.write_bytes(b"PK\3\4 nothing")
    with pytest.raises(SceneError, match="damaged"):
        require_small_archive(path)
