"""Studies over any axes through the API: planned without being queued, named ones changed, their time left told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from service_fakes import HOST, Service, running_service
from sqlalchemy import func, select

from server.cli import app as cli
from server.devices.registry import see_twin
from server.live.study_left import read_left
from server.live.time_left import FIRST_TO_LATER
from server.queue import lives
from server.store.database import Database
from server.store.models import Device, Job, Slice, Study, now
from server.store.records import add_study

MATRIX: dict[str, Any] = {
    "name": "mine",
    "scenes": "cornell-box",
    "axes": {"traversal": "paper", "size": "32,64x16", "sah": "3.0,1.5; 1.5,3.0", "specialise": ["on", "off"]},
    "frames": 2,
    "rounds": 2,
}


@pytest.fixture
def service(tmp_path: Path, database_url: str) -> Iterator[Service]:
    with running_service(tmp_path, database_url) as running:
        yield running


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


def test_a_matrix_over_every_axis_becomes_jobs(service: Service) -> None:
    study = service.post("studies", **MATRIX, models=True)
    assert (study["jobs_total"], study["slices"]["total"]) == (4 * 2 * 2 * 2, 64)
    assert {(job["size"], job["sah"]) for job in study["jobs"]} == {
        (size, costs) for size in ("32x32", "64x16") for costs in ("3.0,1.5", "1.5,3.0")
    }
    with service.database.reading() as session:
        asked = session.scalars(select(Job.request)).all()
    assert all(request["models"] for request in asked)
    assert {request["specialise"] for request in asked} == {True, False}
    assert study["page"] == "/?study=1&rows=traversal,sah,size,specialise"
    assert service.get("studies/1")["left_s"] is None
    service.work()
    done = service.get("studies/1")
    assert (done["state"], done["left_s"], done["left"]) == ("done", 0, None)
    # The stand-in's results are all of specialised plans.
    assert len(service.get(done["results"].removeprefix("/api/v1/"))["table"]) == 4 * 2 * 2
    with service.database.reading() as session:
        parts = session.scalars(select(Slice)).all()
    assert all(part.started_at and part.ended_at and part.started_at <= part.ended_at for part in parts)


def test_a_plan_is_counted_and_not_queued(alone: Service) -> None:
    with alone.database.writing() as session:
        see_twin(session, HOST)
    body = MATRIX | {"axes": MATRIX["axes"] | {"builder": "sah,median"}, "devices": f"llvmpipe,llvmpipe@{HOST}"}
    plan = alone.client.post("/api/v1/studies/plan", json=body)
    assert plan.status_code == 200
    told = plan.json()
    assert (told["jobs"], told["slices"], told["scenes"]) == (6 * 8 * 2, 6 * 8 * 2 * 2, ["cornell-box"])
    assert [item["reason"] for item in told["refused"]] == [
        "median is a BVH builder: a KD-tree is built with sah or clipped."
    ] * 2
    assert alone.get("jobs")["jobs"] == []
    posted = alone.post("studies", **body)
    assert (posted["jobs_total"], posted["slices"]["total"]) == (told["jobs"], told["slices"])
    assert posted["refused"] == told["refused"]


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown axis": ({"scenes": "forest", "axes": {"colour": "red"}}, "Unknown axis 'colour'"),
    "half a pair": ({"scenes": "forest", "axes": {"sah": "3.0"}}, "write them as 3.0,1.5"),
    "costs of nothing": ({"scenes": "forest", "axes": {"sah": "0,1"}}, "SAH traversal cost is 0.0"),
    "wrong size": ({"scenes": "forest", "axes": {"size": "256,red"}}, "640x480"),
    "size 0": ({"scenes": "forest", "axes": {"size": "0"}}, "The width is 0"),
    "wrong switch": ({"scenes": "forest", "axes": {"specialise": "perhaps"}}, "choose one of on, off"),
    "unknown device": ({"scenes": "forest", "devices": "red"}, "There is no device 'red'"),
    "no scene": ({"scenes": []}, "names no scene"),
    "unknown study": ({"name": "red"}, "Unknown study 'red'"),
    "too many": (
        {"scenes": "forest", "axes": {"traversal": "all", "sah": ";".join(f"{i},1" for i in range(1, 20_000))}},
        "combinations, more than",
    ),
    "too many slices": ({"scenes": "forest", "axes": {"sah": ";".join(f"{i},1" for i in range(1, 9_000))}}, "slices"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_plan_is_refused_like_a_submission(alone: Service, name: str) -> None:
    body, words = REFUSED[name]
    for path in ("studies/plan", "studies"):
        answer = alone.client.post(f"/api/v1/{path}", json=body)
        assert answer.status_code == 422, path
        assert words in answer.json()["detail"]
    with alone.database.reading() as session:
        assert session.scalar(select(func.count()).select_from(Study)) == 0


def test_a_named_study_is_changed_where_a_field_is_given(alone: Service) -> None:
    body = {"name": "paper", "scenes": "cornell-box", "size": 64, "axes": {"traversal": "kd-backtrack"}}
    plan = alone.client.post("/api/v1/studies/plan", json=body).json()
    assert (plan["jobs"], plan["slices"]) == (3 + 2 + 3, 8 * 4)
    one = alone.client.post("/api/v1/studies/plan", json=body | {"sah": "1.5,1.5"}).json()
    assert one["jobs"] == 3 + 2


def test_the_time_left_is_told_on_both_databases(service: Service) -> None:
    """Round 0 took 10 s and round 1 took 4 s where it has ended: what is left is as many of them."""
    study = service.post("studies", **{**MATRIX, "axes": {"traversal": "paper"}})["id"]
    assert left(service.database, study) is None
    with service.database.writing() as session:
        see_twin(session, HOST)
    lives.begin(service.database, "elsewhere:1:x", HOST)
    assert left(service.database, study) is None
    end_slices(service.database, study, 0, 4, 10)
    assert left(service.database, study) == pytest.approx(4 * 10 / FIRST_TO_LATER)
    end_slices(service.database, study, 1, 2, 4)
    assert left(service.database, study) == 2 * 4
    assert service.get(f"studies/{study}")["left_s"] == 8
    with service.database.writing() as session:
        session.get_one(Device, f"llvmpipe@{HOST}").presence = "offline"
    assert left(service.database, study) is None
    with service.database.writing() as session:
        empty = add_study(session, "empty", {}, []).id
    assert left(service.database, empty) is None


def test_a_study_is_followed_again(alone: Service, capsys: pytest.CaptureFixture[str]) -> None:
    there = ("--server", str(alone.client.base_url))
    alone.post("studies", **{**MATRIX, "axes": {"traversal": "paper"}})
    with alone.working():
        code = cli.run(["study", "--follow", "1", "--json", *there])
    followed = json.loads(capsys.readouterr().out)
    assert (code, followed["study"]["state"], len(followed["comparison"]["table"])) == (0, "done", 4)
    assert cli.run(["study", "--follow", "1", *there]) == 0
    said = capsys.readouterr()
    assert f"rayfarm study --server {alone.client.base_url} --follow 1".replace("/ --", " --") in said.err
    assert "See it at" in said.out


def test_the_study_paper_on_a_service_ends_in_a_report(
    alone: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    path = tmp_path / "mine.html"
    words = ("study", "paper", "--size", "8", "--report", str(path), "--server", str(alone.client.base_url))
    with alone.working():
        assert cli.run(words) == 0
    assert f"The report is {path}; of the paper's" in capsys.readouterr().err
    assert "<html" in path.read_text(encoding="utf-8")


WRONG: dict[str, tuple[tuple[str, ...], str]] = {
    "no name": (("study",), "Name a study"),
    "no name there": (("study", "--server", "http://127.0.0.1:1"), "--follow ID"),
    "name and number": (("study", "demo", "--follow", "1"), "without a name"),
    "size and number": (("study", "--follow", "1", "--size", "8"), "without a name and a size"),
    "a report of demo": (("study", "demo", "--report", "x.html"), "Only the studies paper and hard-cases have"),
    "a folder for a report": (("study", "paper", "--report", "."), "give --report a file"),
    "no folder for a report": (("study", "paper", "--report", "no/x.html"), "in a folder that exists"),
    "no folder for results": (("study", "demo", "--output", "no/x.json"), "there is no folder no"),
    "fresh there": (("study", "demo", "--fresh", "--server", "http://127.0.0.1:1"), "--fresh is for"),
    "device here": (("study", "demo", "--device", "x"), "add --server"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_makes_no_sense_is_one_sentence(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, sentence = WRONG[name]
    assert cli.run(words) == 2
    said = capsys.readouterr()
    assert (said.out, len(said.err.splitlines())) == ("", 1)
    assert sentence in said.err


def left(database: Database, study: int) -> float | None:
    with database.reading() as session:
        return read_left(session, [study]).get(study)


def end_slices(database: Database, study: int, round_index: int, count: int, seconds: float) -> None:
    """Let the first jobs' slices of a round have been measured in so many seconds."""
    with database.writing() as session:
        found = select(Slice).join(Job).where(Job.study_id == study, Slice.round == round_index).order_by(Slice.id)
        begun = now()
        for part in session.scalars(found.limit(count)):
            part.state, part.started_at, part.ended_at = "done", begun, begun + timedelta(seconds=seconds)
