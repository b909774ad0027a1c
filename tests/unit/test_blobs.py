"""Blobs: named by their content, whole or not there."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from server.store.blobs import BlobError, Blobs


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


def keep(blobs: Blobs, *chunks: bytes) -> str:
    with blobs.receiving() as incoming:
        for chunk in chunks:
            incoming.write(chunk)
        return blobs.keep(incoming)


@pytest.mark.parametrize("chunks", [(b"",), (b"a", b"b" * 1_000_000, b"\0\xff")], ids=["empty", "large"])
def test_what_is_kept_is_read_again(tmp_path: Path, chunks: tuple[bytes, ...]) -> None:
    blobs = Blobs(tmp_path / "made" / "here")
    name = keep(blobs, *chunks)
    assert name == hashlib.sha256(b"".join(chunks)).hexdigest()
    assert b"".join(blobs.read(name)) == b"".join(chunks)
    assert keep(blobs, b"".join(chunks)) == name
    assert names(tmp_path) == [f"{name}.gz"]


def test_what_is_not_kept_is_gone(tmp_path: Path) -> None:
    with Blobs(tmp_path).receiving() as incoming:
        incoming.write(b"half")
        assert len(names(tmp_path)) == 1
    assert names(tmp_path) == []


def test_a_disk_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("server.store.blobs.os.fsync", fail)
    with pytest.raises(BlobError, match="No space left on device"):
        keep(Blobs(tmp_path), b"whole")
    assert names(tmp_path) == []


def test_a_blob_or_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(BlobError, match="set RAYFARM_BLOBS"):
        Blobs(tmp_path).read("0" * 64)
    (tmp_path / "file").write_text("")
    with pytest.raises(BlobError, match=r"cannot be written \(.*\): set RAYFARM_BLOBS"):
        keep(Blobs(tmp_path / "file"), b"x")
