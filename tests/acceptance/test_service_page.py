"""The pages in headless Chromium: the table, the controls, the address as state, hostile names."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from browsing import choose, log, module_browser, screen, text_of, until, wait_for_chart, watched
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select
from service_fakes import SPEEDS, Service, document, running_service

from renderer.request import Request
from renderer.variant import Variant
from server.store.records import Order, add_jobs, add_result

HOSTILE = '<script>alert(1)</script><img src=x onerror="alert(2)"> & "quoted" \'names\''
ROUNDS = 10
PAPER = ("bvh-parent-link", "bvh-restart-trail", "kd-push-down", "kd-backtrack")
browser = module_browser


def measured(request: Request, measurements: list[dict[str, Any]], device: str = "llvmpipe") -> dict[str, Any]:
    """A result with ten rounds of two frames around the time of its speed."""
    speed = SPEEDS[request.variant.traversal]
    frames = [10 / speed * (1 + 0.002 * i) for i in range(ROUNDS) for _ in range(2)]
    return document(request, speed, device) | {"frames_ms": frames, "frames_by_round": [2] * ROUNDS}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with running_service(tmp_path_factory.mktemp("service")) as running:
        running.bench.combine = measured  # type: ignore[method-assign]
        axes = {"traversal": "paper"}
        running.post(
            "studies", name="fakes", scenes="cornell-box,forest", axes=axes, frames=2, rounds=1, vs_embree=True
        )
        running.work()
        running.bench.combine = partial(measured, device=HOSTILE)  # type: ignore[method-assign]
        running.post("jobs", scene="forest", traversal="bvh-stack", frames=1)
        running.work()
        _add_hostile_scene(running)
        yield running


@pytest.fixture
def page(browser: Chrome, service: Service) -> Iterator[Chrome]:
    """The browser on the comparison page; afterwards nothing was refused, logged, popped up or fetched elsewhere."""
    with watched(browser, service.client.base_url):
        browser.get(str(service.client.base_url))
        yield browser


def test_the_table_has_traversals_by_scenes_with_all_figures(page: Chrome) -> None:
    heads = [head.text.split("\n")[0] for head in page.find_elements(By.CSS_SELECTOR, "thead th")]
    assert heads[0] == "traversal"
    assert {"cornell-box", "forest"} <= {head.rstrip("↕↓↑").strip() for head in heads[1:]}
    rows = [head.text for head in page.find_elements(By.CSS_SELECTOR, ".compare tbody th[scope=row]")]
    assert rows == ["bvh-stack", *PAPER]
    cell = _cell(page, "kd-push-down", "cornell-box").text
    for word in (
        "0.900",
        "Mray/s",
        "0.818–1.00",
        "of Embree",
        "65.5 KB",
        "nodes/ray\n34.2",
        "error",
        "2.0×10⁻⁵",
        "edge",
    ):
        assert word in cell
    assert page.find_element(By.CSS_SELECTOR, "caption").text


def test_what_was_not_measured_says_so(page: Chrome) -> None:
    assert _cell(page, "bvh-stack", "cornell-box").text == "not measured"
    assert "not measured" in _cell(page, "bvh-stack", "forest").text  # its ratio to Embree


def test_hostile_names_stay_text(page: Chrome) -> None:
    assert HOSTILE in page.find_element(By.TAG_NAME, "main").text
    assert page.find_elements(By.CSS_SELECTOR, "main script, main img") == []
    wait_for_chart(page)
    assert "<script>alert(1)" in str(page.find_element(By.ID, "chart").get_attribute("textContent"))


def test_controls_change_the_address_and_the_address_is_the_state(page: Chrome) -> None:
    choose(page, "metric", "per_ray_nodes")
    choose(page, "sort", "-traversal")
    query = urlsplit(page.current_url).query
    assert set(query.split("&")) == {"metric=per_ray_nodes", "sort=-traversal"}
    before = _state(page)
    assert before["rows"] == sorted([*PAPER, "bvh-stack"], reverse=True)
    assert before["title"].startswith("Nodes per ray")
    page.get(page.current_url)
    assert _state(page) == before


def test_a_column_head_sorts_the_best_first(page: Chrome) -> None:
    _head(page, "cornell-box").click()
    until(page, lambda: "sort=" in page.current_url)
    best_first = sorted(PAPER, key=lambda name: -SPEEDS[name])
    assert _state(page)["rows"] == [*best_first, "bvh-stack"]
    assert _head(page, "cornell-box").find_element(By.XPATH, "..").get_attribute("aria-sort") == "descending"


def test_filters_are_part_of_the_address(page: Chrome) -> None:
    page.find_element(By.CSS_SELECTOR, ".filters summary").click()
    page.find_element(By.CSS_SELECTOR, "input[name=traversal][value=kd-backtrack]").click()
    until(page, lambda: "traversal=kd-backtrack" in page.current_url)
    assert _state(page)["rows"] == ["kd-backtrack"]


@pytest.mark.parametrize("kind", ["speed", "error", "size", "work", "edge", "ulp"])
def test_the_chart_is_drawn_and_said_in_words(page: Chrome, kind: str) -> None:
    if kind != "speed":
        choose(page, "chart", kind)
        assert f"chart={kind}" in page.current_url
    wait_for_chart(page)
    assert len(page.find_elements(By.CSS_SELECTOR, "#chart .scatterlayer .trace")) >= 2
    assert page.find_elements(By.CSS_SELECTOR, "#chart canvas") == []
    drawn = page.find_elements(By.CSS_SELECTOR, "#chart .scatterlayer .points path")
    page.find_element(By.CSS_SELECTOR, "#chart-points summary").send_keys(Keys.ENTER)
    lines = page.find_elements(By.CSS_SELECTOR, "#chart-points tbody tr")
    assert len(lines) == len(drawn) == 10
    fronts = {line.find_elements(By.CSS_SELECTOR, "td, th")[-1].text for line in lines}
    assert (fronts <= {"on it", "off it"}) == (kind not in ("speed", "work"))
    box = page.find_element(By.ID, "chart").rect
    assert page.find_element(By.ID, "chart-points").rect["y"] >= box["y"] + box["height"]


def test_the_pareto_front_is_the_fastest_of_each_column_where_errors_are_equal(page: Chrome, service: Service) -> None:
    choose(page, "chart", "error")
    wait_for_chart(page)
    page.find_element(By.CSS_SELECTOR, "#chart-points summary").click()
    lines = [line.text for line in page.find_elements(By.CSS_SELECTOR, "#chart-points tbody tr")]
    assert [line.split()[1] for line in lines if line.startswith("cornell-box") and "on it" in line] == [PAPER[0]]
    front = service.get("compare")["pareto"]["error"]
    assert len(front) == 3


def test_a_baseline_gives_ratios_with_intervals_and_verdicts(page: Chrome) -> None:
    choose(page, "baseline", "kd-push-down")
    assert "baseline=kd-push-down" in page.current_url
    faster = _cell(page, "bvh-parent-link", "cornell-box").find_element(By.CLASS_NAME, "ratio").text
    ratio = SPEEDS["bvh-parent-link"] / SPEEDS["kd-push-down"]
    assert f"{ratio:.2f}×" in faster
    assert "faster" in faster
    assert "–" in faster
    assert "slower" in _cell(page, "kd-backtrack", "cornell-box").text
    assert _cell(page, "kd-push-down", "forest").find_element(By.CLASS_NAME, "ratio").text == "baseline"
    before = _state(page)
    page.get(page.current_url)
    assert _state(page) == before
    link = _cell(page, "kd-backtrack", "cornell-box").find_element(By.LINK_TEXT, "difference")
    page.get(str(link.get_attribute("href")))
    assert "kd-push-down → kd-backtrack" in page.find_element(By.TAG_NAME, "main").text
    assert page.find_element(By.CLASS_NAME, "verdict").text == "slower"


def test_rows_and_columns_take_costs_and_specialisation(page: Chrome, service: Service) -> None:
    page.get(f"{service.client.base_url}/?rows=sah,specialise&cols=size&sah=3,1.5")
    assert _state(page)["rows"] == ["3.0,1.5", "on"]
    assert Select(page.find_element(By.NAME, "rows")).first_selected_option.text == "sah, specialise"


def test_every_export_link_answers(page: Chrome, service: Service) -> None:
    choose(page, "baseline", "kd-push-down")
    links = [str(link.get_attribute("href")) for link in page.find_elements(By.CSS_SELECTOR, ".links a")]
    exports = [link for link in links if "/api/" in link]
    assert len(exports) == 7
    assert all("baseline=kd-push-down" in link for link in exports)
    for link in exports:
        answer = service.client.get(link)
        assert answer.status_code == 200, link
        assert answer.content


def test_the_keyboard_reaches_everything_in_order(page: Chrome) -> None:
    seen = []
    for _ in range(60):
        page.switch_to.active_element.send_keys(Keys.TAB)
        at = page.switch_to.active_element
        name = at.get_attribute("name") or at.get_attribute("aria-label") or at.text.split("\n")[0]
        seen.append(str(name))
    wanted = ["Skip to the content", "metric", "rows", "cols", "sort", "baseline", "study", "chart", "Comparison"]
    places = [seen.index(name) for name in wanted]
    assert places == sorted(places)
    assert any(name.startswith("2.00") or name.startswith("0.900") for name in seen)  # A cell's link to its job.


@pytest.mark.parametrize("path", ["/?baseline=kd-push-down&chart=size", "/difference?baseline=job:1&against=job:2"])
def test_pages_fit_a_phone(page: Chrome, service: Service, path: str) -> None:
    with screen(page, 400, mobile=True):
        page.get(f"{service.client.base_url}{path}")
        assert page.execute_script("return document.documentElement.scrollWidth") == 400


def test_a_newcomer_is_told_what_this_is_and_starts_the_demo(browser: Chrome, tmp_path: Path) -> None:
    with running_service(tmp_path) as fresh, watched(browser, fresh.client.base_url) as page:
        page.get(str(fresh.client.base_url))
        text = page.find_element(By.TAG_NAME, "main").text
        assert "Nothing is measured yet" in text
        assert [link.text for link in page.find_elements(By.CSS_SELECTOR, ".steps a")] == [
            "Submit a study",
            "Attach a device",
        ]
        page.find_element(By.ID, "demo").click()
        until(page, lambda: "/studies/1" in page.current_url)
        assert fresh.get("studies/1")["name"] == "demo"
        page.get(str(fresh.client.base_url))
        assert page.find_element(By.CSS_SELECTOR, ".lead a").text == "Study 1: demo"


def test_other_pages_open(page: Chrome, service: Service) -> None:
    base = str(service.client.base_url)
    for path, word in (("studies", "fakes"), ("studies/1", "Jobs of this study"), ("jobs/1", "mrays_per_s")):
        page.get(f"{base}/{path}")
        assert word in page.find_element(By.TAG_NAME, "main").text


def test_the_form_submits_a_study(page: Chrome, service: Service) -> None:
    page.get(f"{service.client.base_url}/submit")
    page.find_element(By.NAME, "size").clear()
    page.find_element(By.NAME, "size").send_keys("0")
    button = page.find_element(By.CSS_SELECTOR, "form button")
    page.execute_script("arguments[0].click()", button)
    problem = page.find_element(By.ID, "problem")
    until(page, problem.is_displayed)
    assert "width" in problem.text
    page.find_element(By.NAME, "size").clear()
    page.find_element(By.NAME, "size").send_keys("32")
    page.execute_script("arguments[0].click()", button)
    until(page, lambda: "/studies/" in page.current_url)
    # The browser logs refused requests itself; the form has what is typed counted, at any moment.
    assert [e["message"] for e in log(page, "browser") if "422" not in e["message"]] == []
    assert "queued" in page.find_element(By.TAG_NAME, "main").text
    service.work()
    until(page, lambda: text_of(page, "state") == "done")


def test_a_job_is_cancelled_from_its_page(service: Service, page: Chrome) -> None:
    job = service.post("jobs", scene="cornell-box", frames=1)
    page.get(f"{service.client.base_url}/jobs/{job['id']}")
    page.find_element(By.CSS_SELECTOR, "[data-cancel]").click()
    until(page, lambda: text_of(page, "state") == "cancelled")
    assert service.get(f"jobs/{job['id']}")["state"] == "cancelled"
    until(page, lambda: page.find_elements(By.CSS_SELECTOR, "[data-cancel]") == [])


def _add_hostile_scene(service: Service) -> None:
    """A result whose scene is no name from the catalogue, as an import might bring one."""
    request = Request("forest", Variant("kd-backtrack"), frames=1, rounds=1)
    with service.database.writing() as session:
        [part] = add_jobs(session, [Order(request)])
        part.state = part.job.state = "done"
        add_result(session, part.job, service.bench.combine(request, [{"speed": 0.5}]) | {"scene": HOSTILE})


def _head(page: Chrome, column: str) -> Any:
    links = page.find_elements(By.CSS_SELECTOR, "thead a")
    return next(link for link in links if link.text.rstrip("↕↓↑").strip() == column)


def _cell(page: Chrome, row: str, column: str) -> Any:
    columns = [link.text.rstrip("↕↓↑").strip() for link in page.find_elements(By.CSS_SELECTOR, "thead a")]
    line = next(
        line
        for line in page.find_elements(By.CSS_SELECTOR, ".compare tbody tr")
        if line.find_element(By.TAG_NAME, "th").text == row
    )
    return line.find_elements(By.TAG_NAME, "td")[columns.index(column)]


def _state(page: Chrome) -> dict[str, Any]:
    return {
        "title": page.find_element(By.TAG_NAME, "h1").text,
        "rows": [head.text for head in page.find_elements(By.CSS_SELECTOR, ".compare tbody th[scope=row]")],
        "cells": [cell.text for cell in page.find_elements(By.CSS_SELECTOR, ".compare tbody td")],
        "controls": [Select(each).first_selected_option.text for each in page.find_elements(By.TAG_NAME, "select")],
    }
