"""Blobs: named by their content, whole or not there, in a folder and in a bucket of an S3 server (moto's)."""

from __future__ import annotations

import gzip
import hashlib
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

from server.settings import Settings, SettingsError, settings
from server.store.blobs import BlobError, Blobs


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


def keep(blobs: Blobs, *chunks: bytes) -> str:
    with blobs.receiving() as incoming:
        for chunk in chunks:
            incoming.write(chunk)
        return blobs.keep(incoming)


@pytest.fixture(scope="module")
def s3(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The URL of a fresh bucket on an S3 server of the test's own."""
    program = Path(sys.executable).with_name("moto_server")
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    with (tmp_path_factory.mktemp("moto") / "log").open("wb") as log, pytest.MonkeyPatch.context() as patch:
        server = subprocess.Popen([program, "-H", "127.0.0.1", "-p", str(port)], stdout=log, stderr=log)
        try:
            _wait_for(address, server)
            httpx.put(f"{address}/rays", trust_env=False).raise_for_status()
            patch.setenv("AWS_ENDPOINT_URL", address)
            patch.setenv("AWS_ALLOW_HTTP", "true")
            for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
                patch.setenv(name, "test")
            patch.setenv("AWS_REGION", "us-east-1")
            yield "s3://rays/some/prefix"
        finally:
            server.terminate()
            server.wait()


def _wait_for(address: str, server: subprocess.Popen[bytes]) -> None:
    for _ in range(600):
        try:
            httpx.get(address, trust_env=False)
        except httpx.TransportError:
            assert server.poll() is None, "the S3 server ended"
            time.sleep(0.1)
        else:
            return
    pytest.fail("the S3 server did not answer in a minute")


@pytest.fixture(params=["folder", "bucket"])
def blobs(request: pytest.FixtureRequest, tmp_path: Path) -> Blobs:
    return Blobs(tmp_path / "made" / "here" if request.param == "folder" else request.getfixturevalue("s3"))


@pytest.mark.parametrize("chunks", [(b"",), (b"a", b"b" * 1_000_000, b"\0\xff")], ids=["empty", "large"])
def test_what_is_kept_is_read_again(blobs: Blobs, chunks: tuple[bytes, ...]) -> None:
    name = keep(blobs, *chunks)
    assert name == hashlib.sha256(b"".join(chunks)).hexdigest()
    assert b"".join(blobs.read(name)) == b"".join(chunks)
    assert keep(blobs, b"".join(chunks)) == name


def test_what_does_not_pack_is_read_in_pieces(blobs: Blobs) -> None:
    noise = [np.random.default_rng(seed).bytes(1 << 20) for seed in range(12)]  # More than one part of an upload.
    pieces = list(blobs.read(keep(blobs, *noise)))
    assert b"".join(pieces) == b"".join(noise)
    assert max(map(len, pieces)) <= 1 << 18


def test_what_packs_well_is_read_in_pieces(blobs: Blobs) -> None:
    pieces = list(blobs.read(keep(blobs, *[bytes(1 << 20)] * 8)))
    assert sum(map(len, pieces)) == 8 << 20
    assert max(map(len, pieces)) <= 1 << 18


def test_a_file_is_kept_under_its_digest_alone(blobs: Blobs, tmp_path: Path) -> None:
    path = tmp_path / "picture"
    path.write_bytes(b"pixels")
    sha256 = hashlib.sha256(b"pixels").hexdigest()
    blobs.keep_file(path, sha256)
    assert b"".join(blobs.read(sha256)) == b"pixels"
    other = hashlib.sha256(b"others").hexdigest()
    with pytest.raises(BlobError, match="another content"):
        blobs.keep_file(path, other)
    with pytest.raises(BlobError, match=r"cannot be read \(No such file"):
        blobs.keep_file(tmp_path / "nowhere", other)
    with pytest.raises(BlobError, match="set RAYFARM_BLOBS"):
        blobs.read(other)


def test_a_folder_holds_the_packed_file_alone(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path)
    name = keep(blobs, b"whole")
    assert names(tmp_path) == [f"{name}.gz"]
    assert gzip.decompress((tmp_path / name[:2] / f"{name}.gz").read_bytes()) == b"whole"


def test_what_gzip_wrote_is_read(tmp_path: Path) -> None:
    name = hashlib.sha256(b"older" * 100_000).hexdigest()
    (tmp_path / name[:2]).mkdir()
    (tmp_path / name[:2] / f"{name}.gz").write_bytes(gzip.compress(b"older" * 100_000, 9))
    assert b"".join(Blobs(tmp_path).read(name)) == b"older" * 100_000


@pytest.mark.parametrize("damage", ["cut", "changed"])
def test_a_damaged_blob_is_told(tmp_path: Path, damage: str) -> None:
    blobs = Blobs(tmp_path)
    name = keep(blobs, np.random.default_rng(3).bytes(10_000))
    path = tmp_path / name[:2] / f"{name}.gz"
    packed = bytearray(path.read_bytes())
    packed[5_000] ^= 255
    path.write_bytes(packed if damage == "changed" else packed[:5_000])
    with pytest.raises(BlobError, match="damaged"):
        list(blobs.read(name))


def test_a_blob_of_another_content_is_told_and_removed(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path)
    name = keep(blobs, b"one")
    (tmp_path / name[:2] / f"{name}.gz").write_bytes(gzip.compress(b"another"))
    with pytest.raises(BlobError, match="damaged"):
        list(blobs.read(name))
    assert names(tmp_path) == []


def test_what_is_not_kept_is_gone(tmp_path: Path) -> None:
    with Blobs(tmp_path).receiving() as incoming:
        incoming.write(b"half")
        assert len(names(tmp_path)) == 1
    assert names(tmp_path) == []


def test_a_disk_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("server.store.blob_places.os.fsync", fail)
    with pytest.raises(BlobError, match="No space left on device"):
        keep(Blobs(tmp_path), b"whole")
    assert names(tmp_path) == []


def test_a_blob_or_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(BlobError, match="set RAYFARM_BLOBS"):
        Blobs(tmp_path).read("0" * 64)
    (tmp_path / "file").write_text("")
    with pytest.raises(BlobError, match=r"cannot be written \(.*\): set RAYFARM_BLOBS"):
        keep(Blobs(tmp_path / "file"), b"x")


def test_a_bucket_that_is_not_there_is_told(s3: str) -> None:
    blobs = Blobs("s3://nowhere/prefix")
    with pytest.raises(BlobError, match="not in this server's bucket s3://nowhere/prefix"):
        blobs.read("0" * 64)
    with pytest.raises(BlobError) as told:
        keep(blobs, b"x")
    assert "cannot be written" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_bucket_that_does_not_answer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("ENDPOINT_URL", "http://127.0.0.1:9"), ("ALLOW_HTTP", "true"), ("REGION", "us-east-1")):
        monkeypatch.setenv(f"AWS_{name}", value)
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "test")
    blobs = Blobs("s3://rays/prefix")
    for use in (lambda: keep(blobs, b"x"), lambda: blobs.read("0" * 64)):
        with pytest.raises(BlobError, match=r"bucket s3://rays/prefix cannot be read \(.*\): check RAYFARM_BLOBS"):
            use()


@pytest.mark.parametrize("where", ["ftp://host/x", "s3://", "s3:///", ""])
def test_a_place_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    monkeypatch.setenv("RAYFARM_BLOBS", where)
    settings.cache_clear()
    try:
        with pytest.raises(SettingsError, match=r"RAYFARM_BLOBS is wrong: give a folder, or s3://bucket/prefix\."):
            settings()
    finally:
        settings.cache_clear()


@pytest.mark.parametrize("where", ["s3://bucket", "s3://bucket/a/b", "/folder", "here", "~/blobs"])
def test_a_folder_or_a_bucket_is_taken(monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    monkeypatch.setenv("RAYFARM_BLOBS", where)
    assert Settings().blobs == where
