"""Pictures of a measurement: the files against the arrays, the same bytes for the same content, and bad files."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from renderer.bench import combine, run_slice
from renderer.pictures.counts import METRICS, Counts
from renderer.pictures.files import PictureError, counts_bytes, read_counts, write_pictures
from renderer.pictures.heatmap import heatmap
from renderer.request import Request
from renderer.variant import Variant

SEED = 71


def random_counts(shape: tuple[int, int] = (5, 7)) -> dict[str, Counts]:
    rng = np.random.default_rng(SEED)
    return {name: rng.integers(0, 1 << 20, shape) for name in METRICS}


def saved(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=True, **arrays)
    return out.getvalue()


def test_a_file_is_named_by_its_bytes_and_holds_the_pictures(tmp_path: Path) -> None:
    image = np.random.default_rng(SEED).integers(0, 256, (5, 7, 4), np.uint8)
    counts = random_counts()
    names = write_pictures(tmp_path, image, counts)
    files = [tmp_path / f"{names['image']}.png", tmp_path / f"{names['counts']}.npz"]
    assert sorted(tmp_path.iterdir()) == sorted(files)
    for path in files:
        assert hashlib.sha256(path.read_bytes()).hexdigest() == path.stem
    with Image.open(files[0]) as shown:
        assert shown.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(shown), image[::-1, :, :3])
    for source in (files[1], files[1].read_bytes()):
        found = read_counts(source)
        assert list(found) == ["nodes", "triangles", "bytes"]
        for name, part in found.items():
            np.testing.assert_array_equal(part, counts[name])


def test_the_file_is_numpy_s(tmp_path: Path) -> None:
    names = write_pictures(tmp_path, np.zeros((5, 7, 3), np.uint8), random_counts())
    with np.load(tmp_path / f"{names['counts']}.npz", allow_pickle=False) as held:
        assert {(held[name].dtype.str, held[name].shape) for name in held} == {("<u4", (5, 7))}


def test_the_bytes_do_not_depend_on_the_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.zeros((5, 7, 3), np.uint8)
    first = write_pictures(tmp_path, image, random_counts())
    for name in ("time", "localtime", "gmtime"):
        old = getattr(__import__("time"), name)
        monkeypatch.setattr(f"time.{name}", lambda *at, old=old: old(*at) if at else old(4e8))
    monkeypatch.setattr("time.time", lambda: 4e8)
    assert write_pictures(tmp_path, image, random_counts()) == first
    assert len(list(tmp_path.iterdir())) == 2


def test_counts_beyond_32_bits_stay_at_the_top() -> None:
    counts = random_counts() | {"bytes": np.full((5, 7), 1 << 40)}
    assert (read_counts(counts_bytes(counts))["bytes"] == 0xFFFFFFFF).all()


def lying_header() -> bytes:
    """A header that claims 2^40 pixels over a few bytes."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as held:
        for name in METRICS:
            part = io.BytesIO()
            header = {"descr": "<u4", "fortran_order": False, "shape": (1 << 20, 1 << 20)}
            np.lib.format.write_array_header_1_0(part, header)
            held.writestr(f"{name}.npy", part.getvalue() + bytes(64))
    return out.getvalue()


def bomb() -> bytes:
    """Zeros that unpack to more than the largest image has."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as held:
        for name in METRICS:
            with held.open(f"{name}.npy", "w") as part:
                for _ in range(65):
                    part.write(bytes(1 << 20))
    return out.getvalue()


def torn() -> bytes:
    data = bytearray(counts_bytes(random_counts((64, 64))))
    data[200:260] = bytes(60)
    return bytes(data)


BAD: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "no zip": lambda: b"\x89PNG\r\n" * 9,
    "cut": lambda: counts_bytes(random_counts())[:-30],
    "torn": torn,
    "other names": lambda: saved(nodes=np.zeros((2, 2), np.uint32)),
    "other type": lambda: saved(**dict.fromkeys(METRICS, np.zeros((2, 2), np.int64))),
    "one row": lambda: saved(**dict.fromkeys(METRICS, np.zeros(4, np.uint32))),
    "objects": lambda: saved(**dict.fromkeys(METRICS, np.array([[{}]], object))),
    "other sizes": lambda: counts_bytes(random_counts() | {"nodes": np.zeros((2, 2), np.int64)}),
    "lying header": lying_header,
    "bomb": bomb,
}


@pytest.mark.parametrize("bad", BAD)
def test_a_file_that_is_no_counts_gets_a_sentence(bad: str) -> None:
    with pytest.raises(PictureError, match=r"^The counts cannot be read \(.*\): measure again\.$"):
        read_counts(BAD[bad]())


def test_a_slice_leaves_its_pictures(tmp_path: Path) -> None:
    request = Request("cornell-box", Variant("kd-push-down"), size=(24, 16), frames=2, rounds=2, check="none")
    first, second = (run_slice(request, index, pictures=tmp_path) for index in range(2))
    result = combine(request, [second, first])
    assert "pictures" not in second
    assert result["pictures"] == first["pictures"]
    with Image.open(tmp_path / f"{result['pictures']['image']}.png") as shown:
        assert shown.size == (24, 16)
        assert len(np.unique(np.asarray(shown))) > 40
    counts = read_counts(tmp_path / f"{result['pictures']['counts']}.npz")
    for metric, part in counts.items():
        np.testing.assert_array_equal(part, heatmap(request, metric))
    # The same picture of another traversal is the same file; what it took is another.
    other = run_slice(replace(request, variant=Variant("bvh-stack")), 0, pictures=tmp_path)["pictures"]
    assert other["image"] == result["pictures"]["image"]
    assert other["counts"] != result["pictures"]["counts"]


def test_without_a_folder_nothing_is_kept() -> None:
    request = Request("cornell-box", size=(16, 16), frames=1, rounds=1, check="none")
    assert combine(request, [run_slice(request, 0)])["pictures"] is None


def test_brute_force_in_passes_has_no_counts(tmp_path: Path) -> None:
    request = Request("forest:40000", Variant("brute-force"), size=(4, 4), frames=1, rounds=1, check="none")
    assert run_slice(request, 0, pictures=tmp_path)["pictures"]["counts"] is None
    assert [path.suffix for path in tmp_path.iterdir()] == [".png"]
