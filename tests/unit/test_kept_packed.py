"""Packed buffers come back from disk bit for bit, and never those of another request, tree or packing."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer import kept_packed, prepare
from renderer.build.tree import SahCosts
from renderer.pack.api import Packed, pack
from renderer.request import Request
from renderer.variant import AXES, Variant, refusal
from scenes.kept import cache_folder
from scenes.load import load

SCENE = "forest:4000"
COMBINED = [
    variant
    for traversal in AXES["traversal"]
    for layout, method, nodes, intersector in (
        ("normal", "compute", "f32", "moller-trumbore"),
        ("split", "fragment", "grid16", "watertight"),
        ("compact", "hybrid", "quant8", "baked"),
    )
    if refusal(variant := Variant(traversal, layout=layout, method=method, nodes=nodes, intersector=intersector))
    is None
]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))
    return cache_folder("packed")


@pytest.fixture
def packings(monkeypatch: pytest.MonkeyPatch) -> list[Request]:
    """Grows by one whenever something is really packed."""
    made: list[Request] = []
    real = pack

    def counted(scene: Any, tree: Any, request: Request) -> Packed:
        made.append(request)
        return real(scene, tree, request)

    monkeypatch.setattr("renderer.prepare.pack", counted)
    return made


def assert_same(first: Any, second: Any) -> None:
    assert type(first) is type(second)
    if dataclasses.is_dataclass(first):
        for field in dataclasses.fields(first):
            assert_same(getattr(first, field.name), getattr(second, field.name))
    elif isinstance(first, np.ndarray):
        np.testing.assert_array_equal(first, second, strict=True)
        assert second.flags.aligned
        assert second.flags.writeable
    else:
        assert first == second


@pytest.mark.parametrize("variant", COMBINED, ids=lambda variant: variant.label)
def test_what_is_packed_once_comes_back(variant: Variant, packings: list[Request]) -> None:
    request = Request(SCENE, variant)
    packed = prepare.prepare(request).packed
    for _ in range(2):
        assert_same(packed, prepare.prepare_again(request).packed)
    assert len(packings) == 2


def test_whatever_changes_the_buffers_changes_the_entry(
    packings: list[Request], monkeypatch: pytest.MonkeyPatch
) -> None:
    request = Request(SCENE, Variant("bvh4-stack"))
    others = [
        request,
        dataclasses.replace(request, variant=Variant("bvh4-stack", layout="split")),
        dataclasses.replace(request, variant=Variant("bvh4-stack", builder="median")),
        dataclasses.replace(request, specialise=False),
        dataclasses.replace(request, costs=SahCosts(1.0, 1.0)),
        dataclasses.replace(request, scene="forest:4100"),
    ]
    for _ in range(2):
        for other in others:
            prepare.prepare_again(other)
    assert packings == others
    monkeypatch.setattr(kept_packed, "_version", lambda: "after an edit of the packing")
    prepare.prepare_again(request)
    assert len(packings) == len(others) + 1


def test_variants_share_the_buffers_that_are_the_same(folder: Path, packings: list[Request]) -> None:
    for traversal in ("bvh-stack", "bvh-parent-link", "bvh-restart-trail"):
        prepare.prepare_again(Request(SCENE, Variant(traversal)))
    primitives = prepare.prepare(Request(SCENE, Variant())).packed.primitives.vertices.nbytes
    assert sum(path.stat().st_size == primitives for path in folder.iterdir()) == 1
    assert len(list(folder.glob("*.json"))) == 3
    assert len(packings) == 4


@pytest.mark.parametrize("suffix", [".json", ".bin"])
@pytest.mark.parametrize("harm", ["flip", "half", "empty", "gone"])
def test_a_damaged_entry_never_comes_back(suffix: str, harm: str, folder: Path) -> None:
    request = Request(SCENE, Variant())
    packed = prepare.prepare_again(request).packed
    path = max(folder.glob(f"*{suffix}"), key=lambda path: path.stat().st_size)
    content = path.read_bytes()
    path.write_bytes(b"" if harm == "empty" else content[: len(content) // 2] if harm == "half" else content)
    if harm == "flip":
        path.write_bytes(content[:50] + bytes([content[50] ^ 4]) + content[51:])
    elif harm == "gone":
        path.unlink()
    assert_same(packed, prepare.prepare_again(request).packed)
    assert_same(packed, prepare.prepare_again(request).packed)


def test_what_was_not_used_for_longest_goes_first(
    folder: Path, packings: list[Request], monkeypatch: pytest.MonkeyPatch
) -> None:
    requests = [Request(f"forest:{4000 + 100 * number}", Variant()) for number in range(4)]
    for request in requests[:3]:
        prepare.prepare_again(request)
    for age, path in enumerate(sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)):
        os.utime(path, (1e9 + age, 1e9 + age))
    prepare.prepare_again(requests[0])
    assert len(packings) == 3
    size = sum(path.stat().st_size for path in folder.iterdir())
    monkeypatch.setattr(kept_packed, "MOST_BYTES", size)
    prepare.prepare_again(requests[3])
    assert sum(path.stat().st_size for path in folder.iterdir()) <= size
    prepare.prepare_again(requests[0])
    prepare.prepare_again(requests[3])
    assert packings == requests
    prepare.prepare_again(requests[1])
    assert len(packings) == 5


def test_a_cache_that_cannot_be_written_is_not_fatal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path / "file"))
    request = Request(SCENE, Variant())
    assert_same(prepare.prepare(request).packed, prepare.prepare_again(request).packed)


def test_bounds_are_those_of_the_vertices_that_are_used() -> None:
    scene = load(SCENE)
    far = dataclasses.replace(scene, vertices=np.vstack([scene.vertices, [[9e9] * 3]]).astype(np.float32))
    np.testing.assert_array_equal(far.bounds, scene.bounds, strict=True)
    corners = scene.triangles.reshape(-1, 3)
    np.testing.assert_array_equal(scene.bounds, [corners.min(axis=0), corners.max(axis=0)])
