"""Hard cases on a service: handed in over HTTP, and their pages in headless Chromium."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsing import fits, log, module_browser, screen, until, wrong
from hard_case_documents import DEVICE, FAMILIES, study
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select
from service_fakes import Service, running_service
from typer.testing import CliRunner

from renderer.hard_cases.study import Ran
from server.cli import hard_cases as cli
from server.cli.app import app
from server.cli.common import Client, ClientError

HOSTILE = '<script>document.title="taken"</script>'
Json = dict[str, Any]
browser = module_browser


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Run 1 keeps every promise, run 2 breaks two, on a device with a hostile name."""
    with running_service(tmp_path_factory.mktemp("service")) as running:
        broken = study(6, device=DEVICE | {"name": HOSTILE}, changed={"stadium": {"nan": 3, "outcome": "ran"}})
        for document in (study(), broken):
            assert running.client.post("/api/v1/hard-cases", json=document).status_code == 201
        yield running


@pytest.fixture
def page(browser: Chrome) -> Iterator[Chrome]:
    log(browser, "browser")
    yield browser
    assert wrong(browser) == []
    assert browser.title != "taken"


def test_a_run_is_found_filtered_and_looked_into(page: Chrome, service: Service) -> None:
    page.get(str(service.client.base_url))
    page.find_element(By.LINK_TEXT, "Hard cases").click()
    assert HOSTILE in page.find_element(By.TAG_NAME, "table").text
    page.find_element(By.LINK_TEXT, "1").click()
    verdicts = [mark.text for mark in page.find_elements(By.CSS_SELECTOR, ".promises .kept")]
    assert verdicts == ["kept"] * 7
    rows = page.find_elements(By.CSS_SELECTOR, ".matrix tbody th a")
    assert [row.text for row in rows] == list(FAMILIES)
    assert "630–636 holes" in page.find_element(By.CSS_SELECTOR, ".matrix").text
    page.find_element(By.CSS_SELECTOR, "input[name=traversal][value=bvh-stack]").click()
    until(page, lambda: "traversal=bvh-stack" in page.current_url)
    assert "630 holes" in page.find_element(By.CSS_SELECTOR, ".matrix").text
    Select(page.find_element(By.NAME, "cols")).select_by_value("box")
    until(page, lambda: "cols=box" in page.current_url)
    assert "traversal=bvh-stack" in page.current_url, "the address has all of the state"
    assert len(page.find_elements(By.CSS_SELECTOR, ".matrix thead th")) == 3
    page.find_element(By.LINK_TEXT, "pbrt-vertices").click()
    table = page.find_element(By.CSS_SELECTOR, ".every").text
    assert "1,057" in table
    assert "3,282 ulp" in table
    assert "kd-backtrack" not in table


def test_two_runs_are_held_against_each_other(page: Chrome, service: Service) -> None:
    page.get(f"{service.client.base_url}/hard-cases")
    page.find_element(By.XPATH, "//button[text()='Compare']").click()
    until(page, lambda: "/difference" in page.current_url)
    text = page.find_element(By.TAG_NAME, "main").text
    for words in ("20 cells answer alike, 1 otherwise", "seed: 5 → 6", "NaN 0 → 3", "more broken"):
        assert words in text
    assert HOSTILE in text


@pytest.mark.parametrize(
    "path", ["", "/1", "/2?show=losses&cols=traversal", "/2/families/stadium", "/difference?baseline=1&against=2"]
)
def test_pages_fit_a_phone(page: Chrome, service: Service, path: str) -> None:
    with screen(page, 390):
        page.get(f"{service.client.base_url}/hard-cases{path}")
        assert fits(page)


def test_the_report_opens_without_a_service(page: Chrome, service: Service, tmp_path: Path) -> None:
    answer = service.client.get("/hard-cases/2/report")
    assert "attachment" in answer.headers["content-disposition"]
    file = tmp_path / "report.html"
    file.write_bytes(answer.content)
    page.get(file.as_uri())
    assert "bvh-stack compute normal on stadium: 3 nan" in page.find_element(By.TAG_NAME, "main").text
    assert len(page.find_elements(By.CSS_SELECTOR, ".matrix tbody tr")) == len(FAMILIES)


def test_the_api_gives_back_what_it_was_given(service: Service) -> None:
    document = study()
    again = service.client.post("/api/v1/hard-cases", json=document)
    assert (again.status_code, again.json()["id"]) == (200, 1)
    assert service.get("hard-cases/1")["document"]["cells"] == document["cells"]
    assert [run["id"] for run in service.get("hard-cases")["runs"]] == [2, 1]
    lines = service.client.get("/api/v1/hard-cases/1?format=csv").text.splitlines()
    assert len(lines) == 1 + len(document["cells"])
    assert lines[0].startswith("family,traversal,method,")


@pytest.mark.parametrize(
    ("body", "status", "words"),
    [
        ("{", 400, "not valid JSON"),
        ("{}", 422, "field study is missing"),
        (json.dumps(study() | {"more": 1}), 422, "There is no field more"),
        (json.dumps(study() | {"families": [{"name": "x", "reason": "", "source": ""}]}), 422, "does not list"),
    ],
)
def test_what_is_no_study_gets_a_sentence(service: Service, body: str, status: int, words: str) -> None:
    answer = service.client.post("/api/v1/hard-cases", content=body)
    assert answer.status_code == status
    assert words in answer.json()["detail"]


@pytest.mark.parametrize(
    ("path", "status"),
    [("/9", 404), ("/x", 404), ("/1?cols=size", 422), ("/1/families/none", 404), ("/difference?baseline=1", 404)],
)
def test_what_is_not_there_says_so(service: Service, path: str, status: int) -> None:
    assert service.client.get(f"/hard-cases{path}").status_code == status


def test_the_cli_runs_reports_and_hands_in(service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = study(8)
    rows = [{key: value for key, value in cell.items() if key != "broken"} for cell in document["cells"]]
    monkeypatch.setattr(cli, "run_order", lambda _order, _say: Ran(rows, DEVICE))
    monkeypatch.chdir(tmp_path)
    server = str(service.client.base_url).rstrip("/")
    done = CliRunner().invoke(app, ["study", "hard-cases", "--server", server, "--output", "study.json"])
    assert done.exit_code == 0, done.output
    assert f"See it at {server}/hard-cases/3" in done.output
    assert json.loads(Path("study.json").read_text())["device"] == DEVICE
    assert "pbrt-vertices" in Path("rayfarm-hard-cases.html").read_text()
    monkeypatch.setattr(Client, "submit", refuse)
    lost = CliRunner().invoke(app, ["study", "hard-cases", "--server", server])
    assert isinstance(lost.exception, ClientError)
    assert "kept in rayfarm-hard-cases.json" in str(lost.exception)
    assert json.loads(Path("rayfarm-hard-cases.json").read_text())["study"] == "hard-cases"


def refuse(*_: object) -> None:
    raise ClientError("The service is full.")
