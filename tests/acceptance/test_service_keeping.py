"""Backup, restore and pruning, on both databases: everything comes back, nothing is overwritten, results stay."""

from __future__ import annotations

import csv
import io
import tarfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from service_fakes import Service, running_service
from sqlalchemy import select, text, update

from server.cli import app as cli
from server.comparison.flat import RAW
from server.keeping.backup import back_up, restore
from server.keeping.copies import save
from server.keeping.errors import KeepingError
from server.keeping.prune import Ages, prune
from server.store.blobs import Blobs
from server.store.database import Database
from server.store.engines import make_engine
from server.store.models import Profile, Result, Slice, now

Fresh = Callable[..., AbstractContextManager[str]]
CSV = b"name,unit,value\nreads,bytes,1\nreads,bytes,3\n"
FORM = {"name": "p.csv", "map": ["@metric=name", "@unit=unit", "@value=value"]}
YEAR = timedelta(days=365)


@pytest.fixture
def blobs(tmp_path: Path) -> Blobs:
    return Blobs(tmp_path / "blobs")


@pytest.fixture
def service(tmp_path: Path, database_url: str, blobs: Blobs) -> Iterator[Service]:
    """A service with two measured jobs, the first with raw frames, a picture and a profile."""
    with running_service(tmp_path, database_url, blobs=blobs.where) as running:
        running.bench.combine = with_raw(running.bench.combine, keep(blobs, picture()))  # type: ignore[method-assign]
        for traversal in ("bvh-stack", "kd-backtrack"):
            running.post("jobs", scene="cornell-box", traversal=traversal, frames=2, rounds=2)
        running.work()
        imported = running.client.post("/api/v1/jobs/1/profiles", params=FORM, content=CSV)
        assert imported.status_code == 201, imported.text
        yield running


def picture() -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (4, 4), (200, 0, 0)).save(out, "PNG")
    return out.getvalue()


def keep(blobs: Blobs, content: bytes) -> str:
    with blobs.receiving() as incoming:
        incoming.write(content)
        return blobs.keep(incoming)


def with_raw(combine: Any, image: str) -> Any:
    def make(request: Any, measurements: Any) -> Any:
        raw = {"frames_ms": [20.0, 21.0], "frames_by_round": [1, 1], "samples": [{"thermal": 1}]}
        named = {"image": image, "counts": None} if request.variant.traversal == "bvh-stack" else None
        return combine(request, measurements) | raw | {"pictures": named, "size": [4, 4]}

    return make


def whole(service_client: Any) -> list[Any]:
    """All that a user sees of the jobs."""
    paths = ("/api/v1/jobs/1", "/api/v1/jobs/2", "/api/v1/jobs/1/frames", "/api/v1/jobs/1/profiles")
    files = ("/api/v1/jobs/1/profiles/1/file", "/api/v1/compare?format=csv", "/api/v1/pictures/1/image")
    answers = [service_client.get(path) for path in (*paths, *files)]
    assert [answer.status_code for answer in answers[:6]] == [200] * 6, [answer.text for answer in answers]
    return [answer.content for answer in answers]


def test_a_backup_of_a_running_farm_comes_back_whole(
    service: Service, blobs: Blobs, tmp_path: Path, database_kind: str, fresh_database: Fresh
) -> None:
    file = tmp_path / "farm.tar"
    report = back_up(service.database_url, blobs, file)
    assert (report.manifest.kind, report.manifest.jobs, report.manifest.results, report.blobs) == (
        database_kind,
        2,
        2,
        2,
    )
    assert file.stat().st_mode & 0o777 == 0o600
    before = whole(service.client)
    elsewhere = Blobs(tmp_path / "elsewhere")
    with fresh_database(database_kind, empty=True) as url:
        assert restore(url, elsewhere, file).blobs == 2
        with running_service(tmp_path / "new", url, blobs=elsewhere.where) as restored:
            assert whole(restored.client) == before
            # What was open goes on, and ids go on where they were.
            assert restored.post("jobs", scene="forest", frames=1)["id"] == 3
            restored.work()
            assert restored.get("jobs/3")["state"] == "done"


def test_a_store_that_is_not_empty_is_overwritten_only_when_asked(
    service: Service, blobs: Blobs, tmp_path: Path, database_kind: str, fresh_database: Fresh
) -> None:
    file = tmp_path / "farm.tar"
    with fresh_database(database_kind) as url:
        back_up(url, Blobs(tmp_path / "none"), file)
    before = whole(service.client)
    with pytest.raises(KeepingError, match="is not empty: name an empty one, or say --overwrite"):
        restore(service.database_url, blobs, file)
    assert whole(service.client) == before
    restore(service.database_url, blobs, file, overwrite=True)
    assert service.get("jobs")["jobs"] == []


def test_a_registered_worker_keeps_its_store(service: Service, blobs: Blobs, tmp_path: Path) -> None:
    back_up(service.database_url, blobs, tmp_path / "farm.tar")
    with service.working(), pytest.raises(KeepingError, match="end servers and workers first"):
        restore(service.database_url, blobs, tmp_path / "farm.tar", overwrite=True)


@pytest.mark.parametrize("damage", ["cut", "database", "blob", "other", "member", "kind"])
def test_what_is_no_whole_backup_is_refused(
    service: Service, blobs: Blobs, tmp_path: Path, damage: str, database_kind: str, fresh_database: Fresh
) -> None:
    file = tmp_path / "farm.tar"
    back_up(service.database_url, blobs, file)
    damaged = spoil(file, damage)
    with fresh_database(database_kind, empty=True) as url:
        if damage == "kind":
            url = (
                f"sqlite:///{tmp_path / 'x.sqlite'}" if database_kind == "postgresql" else "postgresql://127.0.0.1:1/x"
            )
        with pytest.raises((KeepingError, RuntimeError)) as refused:
            restore(url, Blobs(tmp_path / "elsewhere"), damaged)
        assert str(refused.value).endswith(".")
        assert "\n" not in str(refused.value)


def spoil(file: Path, damage: str) -> Path:
    data = file.read_bytes()
    if damage == "cut":
        file.write_bytes(data[: len(data) // 2])
    elif damage == "other":
        file.write_bytes(b"not a backup" * 100)
    elif damage in ("database", "blob"):
        with tarfile.open(file) as archive:
            member = archive.getmembers()[1 if damage == "database" else -1]
        place = member.offset_data + member.size // 2
        file.write_bytes(data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :])
    elif damage == "member":
        with tarfile.open(file, "a") as archive:
            archive.addfile(tarfile.TarInfo("blobs/../../etc/passwd"))
    return file


def test_a_backup_replaces_no_file_and_leaves_none_half(service: Service, blobs: Blobs, tmp_path: Path) -> None:
    file = tmp_path / "farm.tar"
    file.write_text("precious")
    with pytest.raises(KeepingError, match="already"):
        back_up(service.database_url, blobs, file)
    assert file.read_text() == "precious"
    with pytest.raises(KeepingError, match="cannot be written"):
        back_up(service.database_url, blobs, tmp_path / "nowhere" / "farm.tar")
    assert [path.name for path in tmp_path.iterdir() if "backup" in path.name] == []


def test_pruning_takes_raw_data_and_leaves_results(service: Service, blobs: Blobs) -> None:
    age(service, 1, YEAR, blobs)
    compared = figures(service)
    ages = Ages(timedelta(days=90), timedelta(days=180))
    dry = prune(service.database, blobs, ages, dry_run=True)
    assert (dry.frames, dry.files, dry.profiles, dry.blobs) == (1, 1, 1, 2)
    assert len(list(blobs.kept_before(now()))) == 2
    assert prune(service.database, blobs, ages) == dry
    assert prune(service.database, blobs, ages) == type(dry)()
    assert figures(service) == compared
    gone = {
        "/api/v1/jobs/1/frames": "The raw frames of job 1 were pruned on",
        "/api/v1/jobs/1/profiles/1/file": "The text of this profile was pruned on",
    }
    for path, words in gone.items():
        answer = service.client.get(path)
        assert (answer.status_code, answer.json()["detail"].startswith(words)) == (410, True), answer.text
    page = service.client.get("/jobs/1").text
    for words in (
        "The raw frames were pruned on",
        "pictures and listings were pruned on",
        "The original file was pruned",
    ):
        assert words in page
    assert service.get("jobs/1")["result"]["frame_ms"]["median"] == 20.0
    assert service.get("jobs/1/profiles/1")["metrics"][0]["mean"] == 2.0
    assert len(service.get("jobs/2/frames")["frames"]) == 2
    with service.database.reading() as session:
        kept = session.execute(select(Slice.job_id, Slice.measurement).order_by(Slice.id)).all()
    assert {job: measurement is None for job, measurement in kept} == {1: True, 2: False}


def test_a_file_that_something_else_names_or_that_came_again_stays(service: Service, blobs: Blobs) -> None:
    service.post("jobs", scene="forest", frames=2, rounds=2)  # It has the same picture as the first.
    service.work()
    age(service, 1, YEAR, blobs)
    done = prune(service.database, blobs, Ages(None, timedelta(days=180)))
    assert (done.files, done.profiles, done.blobs) == (1, 1, 1)
    [(name, _)] = blobs.kept_before(now())
    assert b"".join(blobs.read(name)) == picture()
    again = service.client.post("/api/v1/jobs/1/profiles", params=FORM, content=CSV)
    assert again.status_code in (200, 201)
    assert service.client.get(again.json()["file"]).content == CSV


def test_the_verbs_back_up_prune_and_restore(
    service: Service, blobs: Blobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from server.settings import settings

    monkeypatch.setenv("RAYFARM_DATABASE_URL", service.database_url)
    monkeypatch.setenv("RAYFARM_BLOBS", blobs.where)
    settings.cache_clear()
    file = str(tmp_path / "farm.tar")
    try:
        assert cli.run(["backup", file]) == 0
        assert cli.run(["restore", file]) == 2
        assert cli.run(["restore", file, "--overwrite", "--json"]) == 0
        assert cli.run(["prune"]) == 2
        assert cli.run(["prune", "--frames-older-than", "90 days"]) == 2
        assert cli.run(["prune", "--frames-older-than", "90d", "--dry-run"]) == 0
    finally:
        settings.cache_clear()
    out, error = capsys.readouterr()
    assert "Backed up 2 jobs, 2 results and 2 files" in out
    assert '"results": 2' in out
    assert "Would prune the raw frames of 0 results" in out
    assert len(error.splitlines()) == 3
    assert service.get("jobs/1")["state"] == "done"


def test_a_damaged_blob_is_told_removed_and_kept_again(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path / "blobs")
    name = keep(blobs, b"content")
    [path] = (tmp_path / "blobs").glob("*/*.gz")
    path.write_bytes(path.read_bytes()[:-6] + b"wrong!")
    with pytest.raises(RuntimeError, match="damaged"):
        list(blobs.read(name))
    assert not path.exists()
    assert keep(blobs, b"content") == name
    assert b"".join(blobs.read(name)) == b"content"


def test_an_old_copy_is_brought_up_to_date(tmp_path: Path) -> None:
    """A backup of an earlier release is one of an earlier schema."""
    old = f"sqlite:///{tmp_path / 'old.sqlite'}"
    Database(old).close()
    engine = make_engine(old)
    with engine.begin() as connection:
        connection.execute(text("ALTER TABLE profiles DROP COLUMN pruned_at"))
        connection.execute(text("ALTER TABLE results DROP COLUMN fetch"))
        connection.execute(text("UPDATE alembic_version SET version_num = '0008'"))
    save(engine.url, tmp_path / "copy.sqlite")
    engine.dispose()
    database = Database(f"sqlite:///{tmp_path / 'copy.sqlite'}")
    with database.reading() as session:
        assert session.scalars(select(Profile)).all() == []
    database.close()


def figures(service: Service) -> list[dict[str, str]]:
    """All columns of a comparison's CSV but those of raw frames and files."""
    rows = csv.DictReader(io.StringIO(service.client.get("/api/v1/compare?format=csv").text))
    return [{name: row[name] for name in row if name not in RAW and not name.startswith("pictures")} for row in rows]


def age(service: Service, job: int, by: timedelta, blobs: Blobs) -> None:
    """Make a job's result, its profiles and all files old."""
    import os

    with service.database.writing() as session:
        session.execute(update(Result).where(Result.job_id == job).values(recorded_at=now() - by))
        session.execute(update(Profile).where(Profile.job_id == job).values(imported_at=now() - by))
    for path in Path(blobs.where).glob("*/*.gz"):
        old = path.stat().st_mtime - by.total_seconds()
        os.utime(path, (old, old))
