from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.build import api, make
from renderer.build.cache import BUILDER_VERSIONS, Kind
from renderer.build.tree import Bvh, Floats, Kd, SahCosts, Tree
from scenes.kept import cache_folder

SEED = 21


def triangles(number: int = 200) -> Floats:
    rng = np.random.default_rng(SEED)
    return (rng.random((number, 1, 3)) + 0.1 * rng.random((number, 3, 3))).astype(np.float32)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RAYFARM_CACHE", str(tmp_path))
    return cache_folder("trees")


@pytest.fixture
def builds(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Grows by one with every tree that is really built."""
    made: list[object] = []
    real = api._timed_build

    def counted(*arguments: Any) -> tuple[Tree, float]:
        made.append(arguments)
        return real(*arguments)

    monkeypatch.setattr(api, "_timed_build", counted)
    return made


def assert_same(first: Tree, second: Tree) -> None:
    assert type(first) is type(second)
    for name, value in vars(first).items():
        other = getattr(second, name)
        np.testing.assert_array_equal(value, other, err_msg=name)
        assert type(value) is type(other)
        if isinstance(value, np.ndarray):
            assert value.dtype == other.dtype


@pytest.mark.parametrize(("kind", "tree_type"), [("bvh", Bvh), ("kd", Kd)])
def test_a_tree_is_built_once(kind: Kind, tree_type: type[Tree], builds: list[object]) -> None:
    first, first_ms = api.build("key", triangles(), kind)
    second, second_ms = api.build("key", triangles(), kind)
    assert isinstance(first, tree_type)
    assert_same(first, second)
    assert first_ms == second_ms > 0.0
    assert len(builds) == 1


def test_whatever_changes_the_tree_changes_the_entry(builds: list[object]) -> None:
    for _ in range(2):
        api.build("key", triangles(), "bvh")
        api.build("other", triangles(), "bvh")
        api.build("key", triangles(), "kd")
        api.build("key", triangles(), "bvh", "median")
        api.build("key", triangles(), "bvh", "sah", SahCosts(1.0, 1.5))
        api.build("key", triangles(), "bvh", "sah", SahCosts(3.0, 1.0))
    assert len(builds) == 6


PINNED: dict[Kind, tuple[int, dict[str, str]]] = {
    "bvh": (
        6,
        {
            "sah": "b1ba2539abf5",
            "binned": "8ed32158d489",
            "median": "dffb04de0dc1",
            "reinserted": "56d67b5eba4a",
            "sbvh": "a672d678cd38",
            "sbvh-reinserted": "f82e0648c2b0",
            "clipped": "efa23881cd7b",
        },
    ),
    "kd": (5, {"sah": "3d4de858cb6e", "clipped": "38dc28341f78"}),
}


@pytest.mark.parametrize("kind", PINNED)
def test_other_trees_have_another_version(kind: Kind) -> None:
    """Where only the trees differ: raise the version in `renderer/build/cache.py` that names them, and pin both."""
    large = np.concatenate([triangles(3000), 5.0 * triangles(100)])
    made = {builder: make.build_uncached(large, kind, builder, SahCosts(1.0, 1.0)) for builder in api.BUILDERS[kind]}
    assert (BUILDER_VERSIONS[kind], {builder: digest(tree) for builder, tree in made.items()}) == PINNED[kind]


def digest(tree: Tree) -> str:
    """Of all that is no float."""
    found = hashlib.sha256()
    for value in vars(tree).values():
        if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
            found.update(value.tobytes())
    return found.hexdigest()[:12]


def damage(name: str, content: bytes) -> bytes:
    if name.startswith("flip"):
        rng = np.random.default_rng(int(name[4:]))
        damaged = bytearray(content)
        damaged[rng.integers(len(content))] ^= 1 << rng.integers(8)
        return bytes(damaged)
    return {
        "empty": b"",
        "text": b"not an archive",
        "half": content[: len(content) // 2],
        "no-end": content[:-1],
    }[name]


@pytest.mark.parametrize("name", ["empty", "text", "half", "no-end", *(f"flip{seed}" for seed in range(40))])
@pytest.mark.parametrize("kind", ["bvh", "kd"])
def test_a_damaged_entry_never_comes_back(kind: Kind, name: str, folder: Path) -> None:
    tree, _ = api.build("key", triangles(), kind)
    (entry,) = folder.iterdir()
    entry.write_bytes(damage(name, entry.read_bytes()))
    assert_same(tree, api.build("key", triangles(), kind)[0])
    assert [path.name for path in folder.iterdir()] == [entry.name]


def test_a_damaged_entry_is_replaced(folder: Path, builds: list[object]) -> None:
    for _ in range(3):
        api.build("key", triangles(), "bvh")
        if len(builds) == 1:
            next(folder.iterdir()).write_bytes(b"")
    assert len(builds) == 2


def test_a_cache_that_cannot_be_written_is_not_fatal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, builds: list[object]
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("RAYFARM_CACHE", str(blocked))
    for _ in range(2):
        api.build("key", triangles(), "bvh")
    assert len(builds) == 2


def test_processes_may_build_the_same_tree_at_once(folder: Path) -> None:
    code = f"""
import numpy as np
from renderer.build.api import build
rng = np.random.default_rng({SEED})
corners = (rng.random((200, 1, 3)) + 0.1 * rng.random((200, 3, 3))).astype(np.float32)
for turn in range(30):
    tree, _ = build(f"key{{turn}}", corners, "bvh")
print(tree.cost)
"""
    both = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=Path.cwd())
        for _ in range(2)
    ]
    costs = [process.communicate(timeout=120)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert costs[0] == costs[1] == f"{api.build('here', triangles(), 'bvh')[0].cost}\n"
    assert {path.suffix for path in folder.iterdir()} == {".npz"}
    assert len(list(folder.iterdir())) == 31


def test_a_kd_tree_by_median_is_refused() -> None:
    with pytest.raises(api.BuildError, match="does not build a KD-tree; take one of sah, clipped"):
        api.build("key", triangles(), "kd", "median")


def test_no_triangles_are_refused() -> None:
    with pytest.raises(api.BuildError, match="no triangles"):
        api.build("key", triangles(0), "bvh")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_coordinates_that_are_not_finite_are_refused(value: float) -> None:
    broken = triangles()
    broken[3, 1, 2] = value
    with pytest.raises(api.BuildError, match="not finite"):
        api.build("key", broken, "bvh")


@pytest.mark.parametrize("costs", [SahCosts(-1.0, 1.0), SahCosts(1.0, float("nan")), SahCosts(float("inf"), 1.0)])
def test_costs_that_mean_nothing_are_refused(costs: SahCosts) -> None:
    with pytest.raises(api.BuildError, match="cost is"):
        api.build("key", triangles(), "kd", "sah", costs)


def test_the_boxes_hold_their_triangles() -> None:
    boxes = make.bounds(triangles())
    assert (boxes[:, 0] == triangles().min(axis=1)).all()
    assert (boxes[:, 1] == triangles().max(axis=1)).all()
