"""Profiles over HTTP and from the command line, on both databases: stored whole or not at all, shown as imported."""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from service_fakes import Service, running_service
from sqlalchemy import func, select

from server.cli import app as cli
from server.store.models import Profile, ProfileMetric

FreshDatabase = Callable[..., AbstractContextManager[str]]
FIXTURES = Path(__file__).parents[1] / "fixtures" / "profiles"
FORMATS = {
    "snapdragon_realtime.csv": ("snapdragon-realtime", 6),
    "snapdragon_draws.csv": ("snapdragon-draws", 2),
    "perfetto.csv": ("perfetto", 4),
    "agi_gapit.csv": ("agi-gapit", 1),
}
NOTHING: dict[str, Any] = {
    "sp_memory_read": None,
    "sp_memory_read_per_s": None,
    "shader_alu_capacity_utilized": None,
    "time_alus_working": None,
    "alu_per_fragment": None,
    "imported": None,
    "ambiguous": [],
}
LONG = b"Process,Category,Metric,Timestamp,TimestampRaw,Value\n"


@contextmanager
def serving(folder: Path, database_url: str | None = None) -> Iterator[Service]:
    """A service with one job that was measured (1) and one that was not (2)."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        patch.setenv("RAYFARM_PROFILE_MB", "1")
        with running_service(folder, database_url) as running:
            running.post("jobs", scene="forest", frames=1, size="32")
            running.work()
            running.post("jobs", scene="forest", frames=1, size="32")
            yield running


@pytest.fixture
def service(tmp_path: Path, database_url: str) -> Iterator[Service]:
    with serving(tmp_path, database_url) as running:
        yield running


@pytest.fixture(scope="module")
def refusing(
    database_kind: str, fresh_database: FreshDatabase, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Service]:
    """One for tests after which it is as before."""
    with fresh_database(database_kind) as url, serving(tmp_path_factory.mktemp("refusing"), url) as running:
        yield running


def post(service: Service, content: bytes | Iterator[bytes], job: int = 1, **params: Any) -> httpx.Response:
    return service.client.post(f"/api/v1/jobs/{job}/profiles", content=content, params=params)


def post_fixture(service: Service, fixture: str, **params: Any) -> Any:
    answer = post(service, (FIXTURES / fixture).read_bytes(), **{"name": fixture, **params})
    assert answer.status_code == 201, answer.text
    return answer.json()


def stored(service: Service) -> tuple[int, int, list[str]]:
    """How many profiles and metrics there are, and what is in the folder of blobs."""
    with service.database.reading() as session:
        rows = (session.scalar(select(func.count()).select_from(table)) or 0 for table in (Profile, ProfileMetric))
        profiles, metrics = rows
    return profiles, metrics, sorted(path.name for path in (service.folder / "blobs").rglob("*") if path.is_file())


def test_every_format_is_found_out_and_given_back(service: Service) -> None:
    views = [post_fixture(service, name) for name in FORMATS]
    for view, (name, (form, metrics)) in zip(views, FORMATS.items(), strict=True):
        original = (FIXTURES / name).read_bytes()
        assert (view["format"], len(view["metrics"]), view["file_name"]) == (form, metrics, name)
        assert (view["size"], view["time_unit"]) == (len(original), "unverified")
        assert service.get(view["url"].removeprefix("/api/v1/")) == view
        file = service.client.get(view["file"])
        assert file.content == original
        assert file.headers["content-disposition"] == f"attachment; filename*=UTF-8''{name}"
        packed = service.folder / "blobs" / view["sha256"][:2] / f"{view['sha256']}.gz"
        assert gzip.decompress(packed.read_bytes()) == original
    listed = service.get("jobs/1/profiles")["profiles"]
    assert listed == [{key: view[key] for key in view if key != "metrics"} for view in reversed(views)]
    assert stored(service) == (4, 13, sorted(f"{view['sha256']}.gz" for view in views))


def test_the_papers_figures_stand_in_the_result(service: Service) -> None:
    assert service.get("jobs/1")["profile"] is None
    post_fixture(service, "snapdragon_realtime.csv")
    realtime = {
        **NOTHING,
        "sp_memory_read_per_s": 170e6,
        "shader_alu_capacity_utilized": 90.5 / 3,
        "time_alus_working": 60.0,
        "alu_per_fragment": 1000.0,
        "imported": "snapdragon-realtime (profile 1)",
    }
    job = service.get("jobs/1")
    assert job["profile"] == job["result"]["profile"] == realtime
    post_fixture(service, "snapdragon_draws.csv")
    assert service.get("jobs/1")["profile"] == {
        **realtime,
        "sp_memory_read": 13312 / 3,
        "alu_per_fragment": 15.5,
        "imported": "snapdragon-draws (profile 2), snapdragon-realtime (profile 1)",
    }
    assert service.get("jobs/2")["profile"] is None


def test_several_series_of_one_metric_are_not_averaged(service: Service) -> None:
    rows = b"a,g,% Time ALUs Working,1,1,10\nb,g,% Time ALUs Working,1,1,30\n"
    assert post(service, LONG + rows).status_code == 201
    expected = {**NOTHING, "ambiguous": ["time_alus_working"]}
    assert service.get("jobs/1")["profile"] == expected


def test_the_papers_figures_stand_in_comparisons(service: Service) -> None:
    post_fixture(service, "snapdragon_realtime.csv")
    table = service.get("compare?metric=profile_sp_memory_read_per_s")
    assert "imported" in table["metric"]["label"]
    cell = table["table"][0]["cells"][0]
    assert cell["figures"]["profile_sp_memory_read_per_s"]["value"] == 170e6
    assert cell["figures"]["profile_sp_memory_read"]["value"] is None
    answer = service.client.get("/api/v1/compare?format=csv")
    lines = list(csv.DictReader(io.StringIO(answer.text)))
    assert (lines[0]["profile_time_alus_working"], lines[0]["profile_sp_memory_read"]) == ("60.0", "")
    assert lines[0]["profile_imported"] == "snapdragon-realtime (profile 1)"
    page = service.client.get("/?metric=profile_sp_memory_read_per_s", headers={"accept": "text/html"})
    assert page.status_code == 200
    assert "SP memory read (imported)" in page.text
    job = service.client.get("/jobs/1", headers={"accept": "text/html"})
    assert "snapdragon-realtime (profile 1)" in job.text


def test_any_csv_by_a_map(service: Service) -> None:
    pairs = ["@time=Time", "SP Memory Read (Bytes)=Ext. read bytes"]
    view = post_fixture(service, "streamline.csv", map=pairs)
    assert view["map"] == {"@time": "Time", "SP Memory Read (Bytes)": "Ext. read bytes"}
    assert service.get("jobs/1")["profile"]["sp_memory_read"] == 650000


def test_the_same_again_is_found_again(service: Service) -> None:
    first = post_fixture(service, "agi_gapit.csv")
    again = post(service, (FIXTURES / "agi_gapit.csv").read_bytes(), name="other.csv")
    assert (again.status_code, again.json()) == (200, first)
    mapped = post(service, (FIXTURES / "agi_gapit.csv").read_bytes(), map=["ALU / Fragment=BeginCmd"])
    assert (mapped.status_code, mapped.json()["id"]) == (201, 2)
    assert len(stored(service)[2]) == 1


@pytest.mark.parametrize(
    ("content", "job", "params", "status", "said"),
    [
        (LONG + b"p,c,FPS,1,1,60\np,c,FPS,2,2,6", 1, {}, 422, "ends within a line"),
        (b"\x7fELF\2\1\0\0", 1, {}, 422, "binary"),
        (b"", 1, {}, 422, "empty"),
        (b"<html>\n", 1, {}, 422, "No known format"),
        (LONG + b"p,c,a (B),1,1,1\np,c,a (B/s),1,1,1\n", 1, {}, 422, "B and B/s"),
        (LONG + b"p,c,a,1,1,1\n", 1, {"format": "perfetto"}, 422, "no Perfetto GPU counters file"),
        (LONG + b"p,c,a,1,1,1\n", 1, {"map": "a"}, 422, "write METRIC=COLUMN"),
        (LONG + b"p,c,a,1,1,1\n", 2, {}, 409, "Job 2 is queued and has no result"),
        (LONG + b"p,c,a,1,1,1\n", 99, {}, 404, "There is no job 99"),
        (LONG + b"p,c,a,1,1,1\n" * 100_000, 1, {}, 413, "raise RAYFARM_PROFILE_MB"),
    ],
    ids=["cut", "binary", "empty", "HTML", "mixed units", "format", "map", "not measured", "no job", "large"],
)
def test_what_is_refused_leaves_nothing(
    refusing: Service, content: bytes, job: int, params: dict[str, str], status: int, said: str
) -> None:
    answer = post(refusing, content, job, **params)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert said in answer.json()["detail"]
    assert stored(refusing) == (0, 0, [])
    assert refusing.get("jobs/1")["profile"] is None


def test_a_form_is_refused(refusing: Service) -> None:
    answer = refusing.client.post("/api/v1/jobs/1/profiles", files={"file": b"x"})
    assert (answer.status_code, stored(refusing)) == (415, (0, 0, []))


def test_a_lost_connection_leaves_nothing(refusing: Service) -> None:
    def cut() -> Iterator[bytes]:
        yield LONG + b"p,c,FPS,1,1,60\n"
        raise ConnectionError("cut")

    with pytest.raises(ConnectionError):
        post(refusing, cut())
    assert post(refusing, b"").status_code == 422
    assert stored(refusing) == (0, 0, [])


def test_a_database_that_fails_stores_nothing(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("the last step")

    monkeypatch.setattr("server.profiles.store.paper_figures", fail)
    assert post(service, (FIXTURES / "agi_gapit.csv").read_bytes()).status_code == 500
    assert stored(service)[:2] == (0, 0)
    assert service.get("jobs/1/profiles") == {"profiles": []}


def test_a_hostile_file_name_is_harmless(service: Service) -> None:
    view = post_fixture(service, "agi_gapit.csv", name='../"; \r\nX: ü.csv')
    assert view["file_name"] == '"; X: ü.csv'
    file = service.client.get(view["file"])
    assert (file.status_code, "x" in file.headers) == (200, False)
    assert file.headers["content-disposition"].endswith("''%22%3B%20X%3A%20%C3%BC.csv")


def test_what_is_not_there(service: Service) -> None:
    view = post_fixture(service, "agi_gapit.csv")
    for path in ("jobs/1/profiles/2", "jobs/2/profiles/1", "jobs/1/profiles/x", "jobs/9/profiles", "jobs/1/profiles/0"):
        assert service.client.get(f"/api/v1/{path}").status_code == 404
    next((service.folder / "blobs").rglob("*.gz")).unlink()
    lost = service.client.get(view["file"])
    assert (lost.status_code, "set RAYFARM_BLOBS" in lost.json()["detail"]) == (503, True)


def rayfarm(service: Service, *words: object) -> int:
    return cli.run(["import-profile", *map(str, words), "--server", str(service.client.base_url)])


def test_the_command_line_imports_and_shows(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    code = rayfarm(service, FIXTURES / "snapdragon_realtime.csv", "--job", 1)
    out, err = capsys.readouterr()
    assert (code, err) == (0, "")
    assert "Profile 1 of job 1: snapdragon-realtime, 18 rows" in out
    assert "FPS[1] (com.example.app)" in out
    assert "1.1e+08" in out
    code = rayfarm(service, FIXTURES / "streamline.csv", "--job", 1, "--map", "GPU=GPU active", "--json")
    assert (code, json.loads(capsys.readouterr().out)["metrics"][0]["mean"]) == (0, 1050.0)
    assert service.get("jobs/1/profiles")["profiles"][0]["file_name"] == "streamline.csv"


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("nowhere.csv", ("--job", 1), "There is no file"),
        ("agi_gapit.csv", ("--job", 7), "There is no job 7."),
        ("agi_gapit.csv", ("--job", 2), "Job 2 is queued and has no result"),
        ("agi_gapit.csv", ("--job", 1, "--format", "perfetto"), "no Perfetto GPU counters file"),
        ("streamline.csv", ("--job", 1), "No known format begins with"),
        ("README.md", ("--job", 1), "No known format begins with"),
    ],
)
def test_the_command_line_refuses_in_one_sentence(
    refusing: Service, capsys: pytest.CaptureFixture[str], name: str, words: tuple[object, ...], said: str
) -> None:
    code = rayfarm(refusing, FIXTURES / name, *words)
    out, err = capsys.readouterr()
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert said in err
    assert stored(refusing) == (0, 0, [])
