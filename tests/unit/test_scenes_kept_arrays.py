"""Arrays in mapped archives: the same as were written, at once in numpy's own format, and never damaged ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenes.kept_arrays import ALIGN, Array, map_arrays, write_arrays

SEED = 5


@pytest.fixture
def arrays() -> dict[str, Array]:
    rng = np.random.default_rng(SEED)
    return {
        "points": rng.random((1000, 3)).astype(np.float32),
        "faces": rng.integers(0, 9, (77, 3), np.int32),
        "axis": rng.integers(0, 3, 13, np.uint8),
        "none": np.zeros((0, 3), np.int32),
        "cost": np.asarray(1.25),
        "note": np.array("grüße"),
    }


def saved(folder: Path, arrays: dict[str, Array]) -> Path:
    path = folder / "x.npz"
    with path.open("wb") as file:
        write_arrays(file, arrays)
    return path


def mapped(path: Path) -> dict[str, Array]:
    with path.open("rb") as file:
        return map_arrays(file)


def assert_same(found: dict[str, Array], arrays: dict[str, Array]) -> None:
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array, strict=True)


def test_arrays_come_back_aligned_and_free_to_be_changed(tmp_path: Path, arrays: dict[str, Array]) -> None:
    path = saved(tmp_path, arrays)
    found = mapped(path)
    assert_same(found, arrays)
    for array in found.values():
        assert array.ctypes.data % ALIGN == 0 or not array.size
        assert array.flags.aligned
        assert array.flags.writeable
    found["points"][:] = 0.0
    assert_same(mapped(path), arrays)


def test_numpy_reads_and_writes_the_same_archives(tmp_path: Path, arrays: dict[str, Array]) -> None:
    with np.load(saved(tmp_path, arrays), allow_pickle=False) as entry:
        assert_same(dict(entry), arrays)
    theirs = tmp_path / "theirs.npz"
    np.savez(theirs, allow_pickle=False, **arrays)
    assert_same(mapped(theirs), arrays)


@pytest.mark.parametrize("turn", range(60))
def test_a_flipped_bit_is_found(tmp_path: Path, arrays: dict[str, Array], turn: int) -> None:
    """Or it is where nothing depends on it."""
    path = saved(tmp_path, arrays)
    content, rng = bytearray(path.read_bytes()), np.random.default_rng(turn)
    content[rng.integers(len(content))] ^= 1 << rng.integers(8)
    path.write_bytes(content)
    try:
        found = mapped(path)
    except Exception:
        return
    for name in found.keys() & arrays.keys():
        np.testing.assert_array_equal(found[name], arrays[name], strict=True)


def test_a_packed_archive_is_refused(tmp_path: Path, arrays: dict[str, Array]) -> None:
    path = tmp_path / "x.npz"
    np.savez_compressed(path, allow_pickle=False, **arrays)
    with pytest.raises(Exception, match="is damaged"):
        mapped(path)
