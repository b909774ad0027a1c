"""The page that holds two sides against each other: its pairs are the API's, its address is its state."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest
from browsing import module_browser, until
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from service_fakes import Service, document, running_service

from renderer.request import Request
from renderer.variant import Variant
from server.store.records import Order, add_jobs, add_result, add_study

HOSTILE = '<b onmouseover="alert(1)">phone</b> & co'
ROUNDS = 10
ANSWERS = {"bvh-stack": "aa", "kd-backtrack": "aa", "bvh-parent-link": "bb"}
TIMES = {"bvh-stack": 10.0, "kd-backtrack": 12.0, "bvh-parent-link": 10.0}
browser = module_browser


def add(
    service: Service, study: int, scene: str, traversal: str, device: str = "llvmpipe", factor: float = 1.0
) -> None:
    draw = random.Random(f"{scene} {traversal} {device}")
    request = Request(scene, Variant(traversal=traversal), frames=20, rounds=ROUNDS)
    frames = [TIMES[traversal] * factor * (1 + 0.01 * draw.random()) for _ in range(2 * ROUNDS)]
    found = document(request, 1.0, device) | {"frames_ms": frames, "frames_by_round": [2] * ROUNDS}
    found["answers_sha"] = ANSWERS[traversal] * 32
    if traversal == "kd-backtrack":
        found |= {"specialised": ["normals", HOSTILE], "structure_bytes": 2 * found["structure_bytes"]}
    with service.database.writing() as session:
        part = add_jobs(session, [Order(request, device)], study_id=study)[0]
        part.job.state = "done"
        add_result(session, part.job, found)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with running_service(tmp_path_factory.mktemp("service")) as running:
        with running.database.writing() as session:
            first, second, same = (add_study(session, name, {}, []).id for name in (HOSTILE, "second", "aa"))
        for scene in ("forest", "cornell-box"):
            for traversal in TIMES:
                add(running, first, scene, traversal)
                add(running, second, scene, traversal, HOSTILE, 0.5)
        add(running, first, "bunny", "bvh-stack")
        for _ in range(4):
            add(running, same, "cornell-box", "bvh-stack")
        yield running


def go(browser: Chrome, service: Service, **params: str) -> str:
    address = service.client.build_request("GET", "/difference", params=params).url
    browser.get(str(address))
    return browser.find_element(By.TAG_NAME, "main").text


def rows(browser: Chrome) -> list[list[str]]:
    lines = browser.find_elements(By.CSS_SELECTOR, ".pairs tbody tr")
    return [[cell.text for cell in line.find_elements(By.CSS_SELECTOR, "th, td")] for line in lines]


def test_pairs_are_those_of_the_api_with_the_slowest_first(browser: Chrome, service: Service) -> None:
    sides = {"baseline": "study:1,traversal=bvh-stack", "against": "study:1,traversal=kd-backtrack"}
    text = go(browser, service, **sides)
    answer = service.client.get("/api/v1/difference", params=sides).json()
    ratios = sorted((pair["ratio"] for pair in answer["pairs"]), reverse=True)
    assert [line[1] for line in rows(browser)] == [f"{ratio:.3f}" for ratio in ratios]
    assert [line[3] for line in rows(browser)] == ["slower"] * 2
    assert "Compared: traversal bvh-stack → kd-backtrack." in text
    assert "2 surely slower by more than 1.0 %" in text
    assert "bunny" in browser.find_element(By.CLASS_NAME, "alone").text
    assert len(browser.find_elements(By.CSS_SELECTOR, ".reach circle.slower")) == 2
    link = str(browser.find_element(By.CSS_SELECTOR, ".links a").get_attribute("href"))
    assert service.client.get(link).json() == answer


def test_size_hits_and_what_was_left_out_stand_beside(browser: Chrome, service: Service) -> None:
    text = go(browser, service, baseline="study:1,traversal=bvh-stack", against="study:1,traversal=kd-backtrack")
    assert [line[5:7] for line in rows(browser)] == [["1.941", "same bits"]] * 2
    assert text.count(f"left out of against: normals, {HOSTILE}") == 2
    go(browser, service, baseline="study:1,traversal=bvh-stack", against="study:1,traversal=bvh-parent-link")
    assert [line[5:7] for line in rows(browser)] == [["1.000", "other bits"]] * 2


def test_device_against_device_names_both_environments_once(browser: Chrome, service: Service) -> None:
    text = go(browser, service, baseline="study:1,device=llvmpipe", against=f"study:2,device={HOSTILE}")
    assert len(rows(browser)) == 6
    assert {line[3] for line in rows(browser)} == {"faster"}
    assert text.count(f"device llvmpipe → {HOSTILE}") == 1
    assert browser.find_elements(By.CSS_SELECTOR, "main b") == []


def test_the_form_makes_the_address_and_the_address_the_form(browser: Chrome, service: Service) -> None:
    go(browser, service)
    offers = [str(o.get_attribute("value")) for o in browser.find_elements(By.CSS_SELECTOR, "#offers option")]
    assert {"study:1", "study:2", "device=llvmpipe", f"device={HOSTILE}", "traversal=bvh-stack"} <= set(offers)
    for name, value in (("baseline", "study:1"), ("against", "study:1,traversal=kd-backtrack"), ("threshold", "50")):
        field = browser.find_element(By.NAME, name)
        field.clear()
        field.send_keys(value)
    browser.find_element(By.CSS_SELECTOR, "#sides button").click()
    until(browser, lambda: "threshold=50" in browser.current_url)
    assert browser.find_element(By.NAME, "against").get_attribute("value") == "study:1,traversal=kd-backtrack"
    before = rows(browser)
    assert before
    browser.get(browser.current_url)
    assert rows(browser) == before


def test_false_alarms_of_the_devices_are_told(browser: Chrome, service: Service) -> None:
    text = go(browser, service, baseline="study:1,traversal=bvh-stack", against="study:1,traversal=bvh-parent-link")
    assert "0 of 2" in text
    found = service.get("false-alarms")["devices"]
    assert [(one["study"], one["setup"]["device"], one["differing"]["tries"]) for one in found] == [(3, "llvmpipe", 2)]
    assert "No study aa of these devices yet" in go(browser, service, baseline="study:2", against="study:2")


BAD: dict[str, tuple[dict[str, str], int, str]] = {
    "one side": ({"baseline": "job:1"}, 422, "One side is empty"),
    "no such job": ({"baseline": "job:999", "against": "job:1"}, 404, "There is no job 999"),
    "a file": ({"baseline": "x.jsonl", "against": "job:1"}, 422, "is not stored here"),
    "clock": ({"baseline": "job:1", "against": "job:2", "clock": "sun"}, 422, "Unknown clock"),
    "threshold": ({"baseline": "job:1", "against": "job:2", "threshold": "nan"}, 422, "from 0 to 1000"),
    "costs": ({"baseline": "sah=red", "against": "sah=3.0,1.5"}, 422, "write them as 3.0,1.5"),
    "markup": ({"baseline": "<b>=1", "against": "job:1"}, 422, "&lt;b&gt;"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_wrong_address_is_one_sentence_above_the_form(service: Service, name: str) -> None:
    params, status, sentence = BAD[name]
    answer = service.client.get("/difference", params=params, headers={"Accept": "text/html"})
    assert answer.status_code == status
    assert sentence in answer.text
    assert 'name="against"' in answer.text


def test_costs_choose_a_side(service: Service) -> None:
    sides = {"baseline": "study:1,sah=3,1.5,traversal=bvh-stack", "against": "study:1,traversal=kd-backtrack"}
    found: dict[str, Any] = service.client.get("/api/v1/difference", params=sides).json()
    assert len(found["pairs"]) == 2
