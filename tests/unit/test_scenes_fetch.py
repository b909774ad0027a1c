"""Downloads, against an archive on the loopback device."""

from __future__ import annotations

import hashlib
import http.server
import io
import tarfile
import threading
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from scenes import catalogue, fetch, places
from scenes.entry import Download, Entry, SourceFile
from scenes.load import load
from scenes.mesh import read_mesh
from scenes.scene import SceneError

CORNERS = [[0.1, 0.2, 0.3], [1 / 3, 0.0, 0.0], [0.0, 1e-7, 0.0], [9.0, 9.0, 9.0]]
MESH = b"".join(b"v %r %r %r\n" % tuple(corner) for corner in CORNERS) + b"f 1 2 3\nf 2 2 3\n"
MEMBER = "thing/mesh.obj"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, str]]:
    """A folder and the address at which it is served."""
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    folder = tmp_path / "served"
    folder.mkdir()
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield folder, f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def write_tar(path: Path, member: str = MEMBER) -> None:
    with tarfile.open(path, "w:gz") as archive:
        info = tarfile.TarInfo(member)
        info.size = len(MESH)
        archive.addfile(info, io.BytesIO(MESH))


def write_zip(path: Path, member: str = MEMBER) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, MESH)


def entry(url: str, sha256: str | None = None, triangles: int = 2) -> Entry:
    base = catalogue.find("stanford-bunny")
    download = Download(url, MEMBER, "bunny.obj", sha256)
    return replace(base, name="thing", triangles=triangles, download=download, drop=())


def fetch_it(wanted: Entry, folder: Path) -> tuple[Path, str]:
    said: list[str] = []
    path = fetch.fetch_entry(wanted, folder, tell=said.append)
    return path, " ".join(said)


def assert_same(path: Path) -> None:
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices, np.array(CORNERS, np.float32))
    np.testing.assert_array_equal(mesh.faces, [[0, 1, 2], [1, 1, 2]])


def test_a_checksum_covers_the_extracted_geometry(served: tuple[Path, str], tmp_path: Path) -> None:
    folder, address = served
    write_tar(folder / "thing.tar.gz")
    cache = tmp_path / "cache" / "scenes"
    path, said = fetch_it(entry(f"{address}/thing.tar.gz", hashlib.sha256(MESH).hexdigest()), cache)
    assert_same(path)
    assert "the sha256 of thing/mesh.obj is the expected one" in said
    assert [p.name for p in cache.iterdir()] == ["fetched_bunny.ply"]


def test_a_count_is_checked_where_no_checksum_is_known(served: tuple[Path, str], tmp_path: Path) -> None:
    folder, address = served
    write_zip(folder / "thing.zip")
    path, said = fetch_it(entry(f"{address}/thing.zip"), tmp_path)
    assert_same(path)
    assert "has the expected 2 triangles (no checksum is known)" in said


def test_progress_goes_to_stderr(served: tuple[Path, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, address = served
    write_zip(folder / "thing.zip")
    fetch.fetch_entry(entry(f"{address}/thing.zip"), tmp_path, tell=lambda _: None, progress=True)
    out, err = capsys.readouterr()
    assert out == ""
    assert "100%" in err


def test_failures_say_what_to_do_by_hand(served: tuple[Path, str], tmp_path: Path) -> None:
    folder, address = served
    write_tar(folder / "thing.tar.gz")
    write_tar(folder / "other.tar.gz", "thing/other.obj")
    write_zip(folder / "other.zip", "thing/other.obj")
    (folder / "cut.tar.gz").write_bytes((folder / "thing.tar.gz").read_bytes()[:60])
    (folder / "page.html").write_bytes(b"<html>moved</html>")
    cache = tmp_path / "cache"
    cases = [
        (entry(f"{address}/thing.tar.gz", "0" * 64), "the checksum of thing/mesh.obj differs"),
        (entry(f"{address}/thing.tar.gz", None, 7), "has 2 triangles instead of 7"),
        (entry(f"{address}/other.tar.gz"), "has no thing/mesh.obj"),
        (entry(f"{address}/other.zip"), "has no thing/mesh.obj"),
        (entry(f"{address}/cut.tar.gz"), "the archive is damaged or has no"),
        (entry(f"{address}/page.html"), "the archive is damaged or has no"),
        (entry(f"{address}/absent.zip"), "the server answered 404"),
        (entry("http://127.0.0.1:1/thing.zip"), "no connection to the server"),
    ]
    for wanted, reason in cases:
        assert wanted.download is not None
        with pytest.raises(SceneError) as caught:
            fetch_it(wanted, cache)
        sentence = str(caught.value)
        assert reason in sentence, wanted.download.url
        assert f"download {wanted.download.url} by hand and put its thing/mesh.obj as bunny.obj into" in sentence
        assert "\n" not in sentence
        assert list(cache.iterdir()) == []


def test_fetched_files_are_found_and_not_fetched_again(
    served: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, address = served
    write_tar(folder / "thing.tar.gz")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    sha = hashlib.sha256(MESH).hexdigest()
    wanted = replace(entry(f"{address}/thing.tar.gz", sha), files=(SourceFile("bunny.obj", sha),))
    monkeypatch.setitem(catalogue.ENTRIES, "thing", wanted)
    said: list[str] = []
    first = fetch.fetch("thing", tell=said.append, progress=False)
    (folder / "thing.tar.gz").unlink()
    assert load("thing").faces.shape == (2, 3)
    assert fetch.fetch("thing", tell=said.append, progress=False) == first
    assert "is here already" in said[-1]
    assert first.parent == places.cache_folder()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("forest", "needs no download"),
        ("cornell-box", "needs no download"),
        ("happy-buddha", "own reconstruction from Stanford's range scans, not Stanford's happy_vrip"),
        ("cornell-buddha", "put happy_recon_1088k.ply into a folder of RAYFARM_SCENES"),
        ("fairy-forest", r"http://www\.sci\.utah\.edu/~wald/animrep/"),
        ("nowhere", "There is no scene 'nowhere'"),
    ],
)
def test_what_cannot_be_fetched(name: str, sentence: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    with pytest.raises(SceneError, match=sentence):
        fetch.fetch(name, tell=lambda _: None)


def test_fetchable_scenes_use_canonical_addresses() -> None:
    hosts = ("https://casual-effects.com/g3d/data10/", "http://graphics.stanford.edu/pub/3Dscanrep/")
    fetchable = [e for e in catalogue.ENTRIES.values() if e.download is not None]
    assert len(fetchable) >= 7
    for listed in fetchable:
        assert listed.download is not None
        assert listed.download.url.startswith(hosts)
        # What someone downloads by hand is looked for too, under the same checksum.
        forms = {(file.name, file.sha256) for file in listed.files}
        assert (listed.download.saved_as, listed.download.sha256) in forms


def test_what_is_kept_loads_like_the_original(tmp_path: Path) -> None:
    """Degenerate triangles, order and the file's normals survive the way through the cache."""
    source = places.find_named("crytek_sponza_262k.ply")
    if source is None:
        pytest.skip("crytek_sponza_262k.ply is not in the folders of RAYFARM_SCENES")
    original = read_mesh(source)
    fetch._keep(original, tmp_path / "kept.ply")
    kept = read_mesh(tmp_path / "kept.ply")
    np.testing.assert_array_equal(kept.vertices, original.vertices)
    np.testing.assert_array_equal(kept.faces, original.faces)
    assert kept.normals is not None
    assert original.normals is not None
    np.testing.assert_allclose(kept.normals, original.normals, atol=1e-6)
