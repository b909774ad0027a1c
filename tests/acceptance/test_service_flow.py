"""From a submission over HTTP through the worker to the comparison."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from service_fakes import SPEEDS, Service, running_service, wait_for
from sqlalchemy.exc import OperationalError

from renderer.child import AsyncSay
from renderer.variant import AXES
from server.queue import ledger
from server.settings import Settings
from server.slices import SliceRunner

PAPER = ["bvh-parent-link", "bvh-restart-trail", "kd-push-down", "kd-backtrack"]


@pytest.fixture
def service(tmp_path: Path, database_url: str) -> Iterator[Service]:
    with running_service(tmp_path, database_url) as running:
        yield running


def test_a_job_runs_and_carries_its_result(service: Service) -> None:
    job = service.post("jobs", scene="cornell-box", traversal="kd-backtrack", size="64x32", frames=4, rounds=2)
    assert (job["state"], job["slices"]) == ("queued", {"done": 0, "total": 2})
    service.work()
    done = service.get(f"jobs/{job['id']}")
    assert done["state"] == "done"
    assert done["slices"] == {"done": 2, "total": 2}
    phases = ["preparing", "running", "judging"]
    assert [change["state"] for change in done["changes"]] == ["queued", *phases, "queued", *phases, "done"]
    assert [done["changes"][i]["reason"] for i in (4, 5)] == ["1 of 2 rounds are done.", "Round 2 of 2 on llvmpipe."]
    assert done["request"]["size"] == [64, 32]
    assert done["result"]["mrays_per_s"] == pytest.approx(SPEEDS["kd-backtrack"])
    assert done["result"]["size"] == [64, 32]


@pytest.mark.parametrize("away", [False, True])
def test_how_far_a_long_build_is_stands_in_the_job_s_history(
    service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, away: bool
) -> None:
    """What cannot be written just now is left out, and fails nothing."""
    text = "building a BVH (sbvh) over 1,087,716 triangles: 40 %"

    async def child(_module: str, _task: Any, _threads: int, _limit_s: float, say: AsyncSay, **more: Any) -> Any:
        await say("preparing")
        await more["note"](text)
        return {"round": 0, "speed": 1.0}

    def fail(*_: Any) -> None:
        raise OperationalError("UPDATE jobs", {}, ConnectionError("away"))

    monkeypatch.setattr("server.slices.run_child_async", child)
    if away:
        monkeypatch.setattr(ledger, "note", fail)
    runner = SliceRunner(service.database, Settings(blobs=str(tmp_path / "blobs")), lambda: True)
    job = service.post("jobs", scene="cornell-box", frames=1)
    with service.working(runner) as worker:
        wait_for(worker.is_idle)
    done = service.get(f"jobs/{job['id']}")
    assert done["state"] == "done"
    told = [change["state"] for change in done["changes"] if change["reason"] == text]
    assert told == ([] if away else ["preparing"])


def test_a_studys_slices_are_interleaved_in_rounds(service: Service) -> None:
    first = {"name": "one", "scenes": ["cornell-box", "forest"], "axes": {"traversal": "bvh-stack,kd-backtrack"}}
    service.post("studies", **first, frames=3, rounds=3)
    service.post("jobs", scene="cornell-box", frames=1)
    service.work()
    pairs = [(s, t) for s in ("cornell-box", "forest") for t in ("bvh-stack", "kd-backtrack")]
    expected = [(s, t, r) for r in range(3) for s, t in pairs] + [("cornell-box", "bvh-stack", 0)]
    assert service.bench.order == expected


def test_a_study_lists_what_it_leaves_out(service: Service) -> None:
    axes = {"traversal": "paper", "method": ["fragment", "hybrid"], "builder": "sah,median"}
    study = service.post("studies", name="mine", scenes="cornell-box", axes=axes, frames=1)
    refused = {(item["traversal"], item["builder"]) for item in study["refused"]}
    assert refused == {("kd-push-down", "median"), ("kd-backtrack", "median")}
    assert all("KD-tree" in item["reason"] for item in study["refused"])
    assert len(study["jobs"]) == 2 * (2 * 2 + 2)
    assert study["jobs_by_state"]["queued"] == len(study["jobs"])


def test_all_leaves_out_brute_force_where_it_is_too_much(service: Service) -> None:
    axes = {"traversal": "all", "method": "compute"}
    study = service.post("studies", name="mine", scenes="cornell-box,forest", axes=axes, size=256)
    assert [(item["scene"], item["traversal"]) for item in study["refused"]] == [("forest", "brute-force")]
    assert len(study["jobs"]) == 2 * len(AXES["traversal"]) - 1


def test_the_demo_study_has_the_papers_four_and_the_stack(service: Service) -> None:
    study = service.post("studies", name="demo", rounds=1, frames=1)
    service.work()
    assert service.get(f"studies/{study['id']}")["state"] == "done"
    table = service.get(f"compare?study={study['id']}")
    assert sorted(row["key"]["traversal"] for row in table["table"]) == sorted([*PAPER, "bvh-stack"])
    scenes = [column["scene"] for column in table["column_keys"]]
    assert {"cornell-box", "forest"} <= set(scenes)
    for row in table["table"]:
        for cell in row["cells"]:
            assert cell["figures"]["vs_embree_ratio"]["value"] > 0
            assert cell["figures"]["error_total"]["value"] == pytest.approx(2e-5)


def test_comparison_gives_intervals_and_null_for_what_was_not_measured(service: Service) -> None:
    service.post("jobs", scene="cornell-box", method="hybrid", frames=1)
    service.work()
    figures = service.get("compare")["table"][0]["cells"][0]["figures"]
    speed = SPEEDS["bvh-stack"]
    assert figures["mrays_per_s"] == {
        "value": pytest.approx(speed),
        "low": pytest.approx(speed * 20 / 22),
        "high": pytest.approx(speed * 20 / 18),
    }
    assert figures["error_false_miss"]["value"] is None
    assert figures["error_total"]["value"] is None
    assert figures["vs_embree_ratio"]["value"] is None


def test_results_of_different_settings_are_not_averaged(service: Service) -> None:
    for size in (64, 128):
        service.post("jobs", scene="cornell-box", size=size, frames=1)
    service.work()
    table = service.get("compare?cells=results")
    cell = table["table"][0]["cells"][0]
    assert (cell["count"], cell["differs"], cell["result"]["size"]) == (2, ["size"], "128x128")
    assert "differ in size" in table["notes"][0]
    split = service.get("compare?cols=scene,size&rows=traversal")
    assert [key["size"] for key in split["column_keys"]] == ["64x64", "128x128"] or len(split["column_keys"]) == 2
    assert split["notes"] == []


def test_csv_has_a_line_a_result_with_underscores_between_levels(service: Service) -> None:
    service.post("studies", name="x", scenes="cornell-box", axes={"traversal": "paper"}, frames=1, vs_embree=True)
    service.work()
    answer = service.client.get("/api/v1/compare?format=csv&traversal=kd-push-down,bvh-parent-link")
    assert answer.headers["content-type"].startswith("text/csv")
    lines = list(csv.DictReader(io.StringIO(answer.text)))
    assert {line["traversal"] for line in lines} == {"kd-push-down", "bvh-parent-link"}
    line = next(line for line in lines if line["traversal"] == "kd-push-down")
    assert float(line["frame_ms_ci_high"]) == 22.0
    assert float(line["vs_embree_ratio"]) == pytest.approx(SPEEDS["kd-push-down"] * 0.9 / 4)
    assert (line["size"], line["per_ray_lines"], line["error_flip"]) == ("1024x1024", "", "")


def test_csv_table_pivots_the_metric(service: Service) -> None:
    service.post("studies", name="x", scenes="cornell-box,forest", axes={"traversal": "paper"}, frames=1)
    service.work()
    answer = service.client.get("/api/v1/compare?format=csv&shape=table&metric=per_ray.nodes")
    lines = list(csv.DictReader(io.StringIO(answer.text)))
    assert [line["traversal"] for line in lines] == ["bvh-parent-link", "bvh-restart-trail", *PAPER[2:]]
    assert [float(line["forest"]) for line in lines] == [34.25] * 4


def test_sorting_by_a_column_puts_the_best_first(service: Service) -> None:
    service.post("studies", name="x", scenes="forest", axes={"traversal": "paper"}, frames=1)
    service.work()

    def order(query: str) -> list[str]:
        return [row["key"]["traversal"] for row in service.get(f"compare?{query}")["table"]]

    best_first = sorted(PAPER, key=lambda name: -SPEEDS[name])
    assert order("sort=forest") == best_first
    assert order("sort=-forest") == best_first[::-1]
    assert order("sort=forest&metric=frame_ms_median") == order("metric=frame_ms_median")
    assert order("sort=-traversal") == sorted(PAPER, reverse=True)


def test_jobs_are_listed_newest_first_in_pages(service: Service) -> None:
    ids = [service.post("jobs", scene="cornell-box", frames=1)["id"] for _ in range(3)]
    page = service.get("jobs?limit=2&state=queued")
    assert [job["id"] for job in page["jobs"]] == ids[:0:-1]
    rest = service.client.get(page["next"]).json()
    assert [job["id"] for job in rest["jobs"]] == ids[:1]
    assert rest["next"] is None


def test_a_cancelled_job_is_not_measured(service: Service) -> None:
    job = service.post("jobs", scene="cornell-box", frames=2, rounds=2)
    answer = service.client.post(f"/api/v1/jobs/{job['id']}/cancel")
    assert (answer.status_code, answer.json()["state"]) == (200, "cancelled")
    service.work()
    assert service.bench.order == []
    again = service.client.post(f"/api/v1/jobs/{job['id']}/cancel")
    assert again.status_code == 409
