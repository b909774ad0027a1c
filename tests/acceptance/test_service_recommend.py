"""Recommendations through the queue, over HTTP, on pages and on the command line, with the real pilot on the twin."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from browsing import running_browser, until, watched
from selenium.webdriver.common.by import By
from service_fakes import LEASE_S, Service, running_service, wait_for

from server.cli.app import run
from server.settings import Settings
from server.slices import SliceRunner
from server.worker import Worker

AXES = {
    "traversal": "bvh-stack,bvh-restart-trail",
    "method": "fragment,hybrid",
    "layout": "normal",
    "nodes": "f32",
    "fetch": "storage",
}


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


@contextmanager
def working(service: Service) -> Iterator[Worker]:
    """A worker with real children."""
    settings = Settings(database_url=service.database_url, blobs=str(service.folder / "blobs"), lease_s=LEASE_S)
    runner = SliceRunner(service.database, settings, lambda: True)
    with service.working(run_slice=runner) as worker:
        yield worker


def work(service: Service) -> None:
    """Take everything from the queue."""
    with working(service) as worker:
        wait_for(worker.is_idle, 120)


def test_a_recommendation_goes_through_the_queue_and_names_a_variant(service: Service) -> None:
    asked = service.post("recommendations", scene="cornell-box", axes=AXES, size="64x48", rounds=7, memory_budget="1M")
    assert (asked["state"], asked["variants"], asked["recommendation"]) == ("queued", 4, None)
    assert asked["memory_budget"] == 1 << 20
    work(service)
    view = service.get(f"recommendations/{asked['id']}")
    assert view["state"] == "done", view["reason"]
    found = view["recommendation"]
    labels = [one["label"] for one in found["finalists"]]
    assert found["pick"]["label"] == labels[0]
    assert view["pick"] == found["pick"]
    assert found["verdict"].startswith(f"Take {labels[0]}.")
    assert found["pick"]["frame_ms"] > 0
    assert all(one["low"] <= one["ratio"] <= one["high"] for one in found["finalists"])
    assert any("variants at 64x48" in (change["reason"] or "") for change in view["changes"])
    # Its frames are no result: nothing of it is compared.
    assert "There is no result in" in service.client.get(f"/api/v1/results?of=job:{asked['id']}").text
    assert service.get(f"jobs/{asked['id']}")["result"] is None
    assert service.get("recommendations")["recommendations"][0]["verdict"] == found["verdict"]


def test_pages_show_the_form_and_what_came_of_it(service: Service) -> None:
    # Of so few triangles both builders make trees that are as fast: whoever leads, another stays.
    twins = AXES | {"traversal": "bvh-stack", "builder": "sah,reinserted"}
    first = service.post("recommendations", scene="cornell-box", axes=twins, size=64, rounds=2)
    waiting = service.client.get(first["page"])
    assert waiting.status_code == 200
    assert "It waits for a worker, and none is running" in waiting.text
    work(service)
    page = service.client.get(first["page"])
    assert "Take bvh-stack" in page.text
    assert "none: too few rounds" in page.text
    assert "kept. It took" in page.text
    assert "0.0e+00" not in page.text
    listed = service.client.get("/recommend?scene=forest")
    assert 'value="forest" selected' in listed.text
    assert first["page"] in listed.text
    moved = service.client.get(f"/jobs/{first['id']}")
    assert (moved.status_code, moved.headers["location"]) == (303, first["page"])
    assert service.client.get("/recommend/999").status_code == 404


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"scene": "nowhere"}, "nowhere"),
        ({"axes": {"traversal": "fastest"}}, "Unknown traversal 'fastest'"),
        ({"axes": {"size": "64"}}, "The axis size is none that a recommendation chooses from"),
        ({"error_budget": 2}, "The error budget is 2.0"),
        ({"memory_budget": "lots"}, "The memory budget 'lots' is not understood"),
        ({"memory_budget": 0}, "The memory budget is 0 bytes"),
        ({"rounds": 1}, "The rounds are 1"),
        ({"device": "nobody"}, "There is no device 'nobody'"),
        ({"axes": {"method": "hybrid"}, "rays": "primary"}, "Every combination of the study is refused"),
    ],
)
def test_bad_input_gets_one_sentence_and_queues_nothing(
    service: Service, body: dict[str, object], sentence: str
) -> None:
    answer = service.client.post("/api/v1/recommendations", json={"scene": "cornell-box", **body})
    assert answer.status_code in (404, 422)
    assert sentence in answer.json()["detail"]
    assert service.get("recommendations")["recommendations"] == []


def test_the_command_line_recommends_here(capsys: pytest.CaptureFixture[str]) -> None:
    axes = [f"--{axis}={words}" for axis, words in AXES.items()]
    assert run(["recommend", "cornell-box", *axes, "--size=64", "--rounds=2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["pick"]["traversal"] in ("bvh-stack", "bvh-restart-trail")
    named = {one["label"] for part in ("finalists", "unconfirmed", "eliminated", "unable") for one in found[part]}
    assert len(named) == 4
    code = run(["recommend", "cornell-box", *axes, "--size=64", "--rounds=2", "--memory-budget=100"])
    assert code == 1
    assert "over the memory budget" in capsys.readouterr().out


def test_the_command_line_recommends_on_a_service(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    axes = [f"--{axis}={words}" for axis, words in AXES.items()]
    with working(service):
        address = str(service.client.base_url)
        assert run(["recommend", "cornell-box", *axes, "--size=64", "--rounds=2", "--server", address]) == 0
    told = capsys.readouterr()
    assert told.out.startswith("Take bvh-")
    assert "See it at http" in told.err
    code = run(["recommend", "nowhere", "--server", address])
    assert code == 2
    assert "nowhere" in capsys.readouterr().err


def test_the_form_submits_and_the_page_follows_to_the_verdict(service: Service, tmp_path: Path) -> None:
    base = service.client.base_url
    with working(service), running_browser(tmp_path / "profile") as chrome, watched(chrome, base):
        chrome.get(f"{base}/recommend?scene=cornell-box")
        chrome.find_element(By.CSS_SELECTOR, "summary").click()
        for box in chrome.find_elements(By.CSS_SELECTOR, "[data-axis] input:checked"):
            kept = box.get_attribute("value") in ("bvh-stack", "kd-backtrack", "fragment", "normal", "f32")
            if box.get_attribute("name") in ("traversal", "method", "layout", "nodes") and not kept:
                box.click()
        size = chrome.find_element(By.NAME, "size")
        size.clear()
        size.send_keys("64")
        chrome.find_element(By.CSS_SELECTOR, "button[type=submit]").click()
        until(chrome, lambda: chrome.find_element(By.CSS_SELECTOR, ".verdict-sentence").text.startswith("Take "), 60)
        # Confirmed at the full size or left in the pilot, as fast as they happened to be.
        named = "".join(table.text for table in chrome.find_elements(By.CSS_SELECTOR, "table.list"))
        assert "bvh-stack fragment normal" in named
        assert "kd-backtrack fragment normal" in named
