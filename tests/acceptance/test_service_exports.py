"""A comparison's exports over HTTP and by the command: every format answers, and says the same."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from service_fakes import Service, document, running_service

from renderer.request import Request
from renderer.variant import Variant
from server.cli import app as cli
from server.comparison import stored_rows
from server.comparison.sides import read_results
from server.store.records import Order, add_jobs, add_result

HOSTILE = "=1+1 | $x$ & {} \\ _ %"
COUNT = 25


def add(service: Service, name: str, number: int) -> dict[str, Any]:
    request = Request("forest", Variant("kd-backtrack"), frames=4, rounds=2)
    frames = [10.0 + number, 11.25, 12.5, 13.0]
    found = document(request, 1.0 + number, "llvmpipe") | {"frames_ms": frames, "frames_by_round": [2, 2]}
    found |= {"scene": name, "frames_cpu_ms": []}
    with service.database.writing() as session:
        [part, _] = add_jobs(session, [Order(request)])
        part.job.state = "done"
        add_result(session, part.job, found)
    return found


@pytest.fixture
def service(tmp_path: Path, database_url: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Service]:
    monkeypatch.setattr(stored_rows, "PAGE", 10)
    with running_service(tmp_path, database_url) as running:
        for number in range(COUNT):
            add(running, HOSTILE if number % 5 == 0 else "forest", number)
        yield running


def export(service: Service, form: str, **params: str) -> bytes:
    answer = service.client.get("/api/v1/compare", params={"format": form, **params})
    assert answer.status_code == 200, answer.text
    return answer.content


def test_every_result_is_in_every_file_with_its_values(service: Service) -> None:
    lines = [json.loads(line) for line in export(service, "jsonl").splitlines()]
    table = pq.read_table(io.BytesIO(export(service, "parquet"))).to_pylist()
    rows = list(csv.DictReader(io.StringIO(export(service, "csv").decode())))
    assert [line["job"] for line in lines] == list(range(COUNT, 0, -1))
    assert [row["job"] for row in table] == [line["job"] for line in lines] == [int(row["job"]) for row in rows]
    for line, row, text in zip(lines, table, rows, strict=True):
        # Parquet and JSON Lines carry what was measured; a CSV must not be a formula.
        assert line["scene"] == row["scene"] == text["scene"].removeprefix("'")
        assert line["frames_ms"] == row["frames_ms"] == json.loads(text["frames_ms"])
        assert line["mrays_per_s"] == row["mrays_per_s"] == float(text["mrays_per_s"])
        assert line["recorded_at"] == row["recorded_at"] == text["recorded_at"]
    assert {text["scene"] for text in rows} == {f"'{HOSTILE}", "forest"}


def test_json_lines_are_the_results_as_they_were_and_may_be_compared_again(service: Service, tmp_path: Path) -> None:
    newest = add(service, "bunny", 99)
    exported = export(service, "jsonl", scene="bunny")
    found = json.loads(exported)
    assert {name: found[name] for name in newest} == json.loads(json.dumps(newest))
    (tmp_path / "side.jsonl").write_bytes(exported)
    assert read_results(str(tmp_path / "side.jsonl")) == [found]


@pytest.mark.parametrize("form", ["markdown", "latex"])
def test_the_table_is_as_it_is_shown(service: Service, form: str) -> None:
    text = export(service, form, scene="forest", rows="traversal,layout").decode()
    assert "25.0 Mray/s" in text
    assert "latest of 20" in text
    assert "kd-backtrack" in text
    assert "not measured" not in text


@pytest.mark.parametrize("form", ["csv", "jsonl", "parquet", "markdown", "latex"])
def test_the_command_writes_what_the_service_answers(
    service: Service, form: str, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    file = tmp_path / "out"
    there = ("--server", str(service.client.base_url), "--format", form)
    assert cli.run(("compare", "scene=forest", *there, "--output", str(file))) == 0
    assert file.read_bytes() == export(service, form, scene="forest")
    assert [path.name for path in tmp_path.glob("out*")] == ["out"]
    capfdbinary.readouterr()
    assert cli.run(("compare", "scene=forest", *there)) == 0
    assert capfdbinary.readouterr().out == file.read_bytes()


BAD = {
    "format": (("--format", "xml"), "Unknown format 'xml'"),
    "place": (("--format", "csv", "--output", "/nowhere/at/all"), "cannot be written"),
    "filter": (("sah=red", "--format", "jsonl"), "write them as 3.0,1.5"),
    "front": (("--front", "colour"), "Unknown front 'colour'"),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("database_kind", ["sqlite"], indirect=True)
def test_what_cannot_be_is_one_sentence(service: Service, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, sentence = BAD[name]
    assert cli.run(("compare", *words, "--server", str(service.client.base_url))) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sentence in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("database_kind", ["sqlite"], indirect=True)
def test_ratios_and_fronts_in_json_and_terminal(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    request = Request("forest", Variant("bvh-stack"), frames=2, rounds=1)
    service.bench.combine = lambda *_: document(request, 50.0) | {"frames_ms": [5.0, 5.0], "frames_by_round": [2]}  # type: ignore[method-assign]
    service.post("jobs", scene="forest", frames=2, rounds=1)
    service.work()
    view = service.get("compare?baseline=kd-backtrack&scene=forest")
    cells = {row["label"]: row["cells"][0] for row in view["table"]}
    assert view["baseline"] == "kd-backtrack"
    assert cells["kd-backtrack"]["ratio"]["verdict"] == "baseline"
    assert cells["bvh-stack"]["ratio"]["note"] == "no interval: fewer than 4 rounds"
    assert [view["table"][place]["label"] for place in view["pareto"]["error"][0]] == ["bvh-stack"]
    words = ("compare", "scene=forest", "--ratio-to", "kd-backtrack", "--front", "error")
    assert cli.run((*words, "--server", str(service.client.base_url))) == 0
    out = capsys.readouterr().out
    assert "baseline" in out
    assert "Pareto front of speed against error, forest: bvh-stack" in out
