"""Studies in headless Chromium: counted and submitted from the form, watched as they go on, thousands of jobs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from browsing import fits, log, module_browser, requested, screen, text_of, until, watched
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from service_fakes import HOST, Service, running_service
from sqlalchemy import select

from renderer.request import Request
from renderer.variant import AXES, matrix
from server.devices.registry import see_twin
from server.queue import lives
from server.store.models import Job, Slice, now
from server.store.records import Order, add_jobs, add_study, change_state

HOSTILE = '<img src=x onerror="alert(1)"> & <b>bold</b>'
browser = module_browser


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        with running.database.writing() as session:
            see_twin(session, HOST)
        lives.begin(running.database, "elsewhere:1:x", HOST)
        yield running


@pytest.fixture
def page(browser: Chrome, service: Service) -> Iterator[Chrome]:
    """The browser; afterwards nothing was logged that a test did not read, or fetched from another host."""
    with watched(browser, service.client.base_url):
        yield browser


def test_the_form_counts_what_is_ticked_before_it_submits(page: Chrome, service: Service) -> None:
    page.get(f"{address(service)}/submit")
    until(page, lambda: text_of(page, "count") == "1 job, 4 slices.")
    tick(page, "traversal", "kd-backtrack")
    until(page, lambda: text_of(page, "count") == "2 jobs, 8 slices.")
    tick(page, "builder", "median")
    until(page, lambda: text_of(page, "count") == "3 jobs, 12 slices.")
    assert text_of(page, "refused").startswith("1 combination left out")
    write(page, "sah", "3.0,1.5; 1.5,1.5")
    until(page, lambda: text_of(page, "count") == "6 jobs, 24 slices.")
    write(page, "size", "32,64")
    tick(page, "models")
    until(page, lambda: text_of(page, "count") == "12 jobs, 48 slices.")
    submit(page)
    until(page, lambda: "/studies/" in page.current_url)
    study = service.get("studies/1")
    assert study["jobs_total"] == 12
    with service.database.reading() as session:
        asked = [Request.from_json(data) for data in session.scalars(select(Job.request))]
    assert {request.size for request in asked} == {(32, 32), (64, 64)}
    assert {request.costs.traversal for request in asked} == {3.0, 1.5}
    assert all(request.models and request.vs_embree for request in asked)
    heads = [head.text for head in page.find_elements(By.CSS_SELECTOR, "thead th")]
    assert heads == ["Job", "Scene", "Variant", "Size", "SAH costs", "Device", "State", "Reason"]


def test_what_is_wrong_is_said_while_it_is_typed(page: Chrome, service: Service) -> None:
    page.get(f"{address(service)}/submit")
    until(page, lambda: text_of(page, "count") == "1 job, 4 slices.")
    write(page, "sah", "3.0")
    until(page, lambda: "write them as 3.0,1.5" in text_of(page, "count"))
    assert [entry["message"] for entry in log(page, "browser") if "422" not in entry["message"]] == []


def test_a_named_study_is_chosen_with_what_it_measures(page: Chrome, service: Service) -> None:
    service.post("studies", name="demo", frames=2, rounds=1, size=16)
    service.work()
    page.get(f"{address(service)}/submit")
    named = {each.get_attribute("value"): label_of(each) for each in page.find_elements(By.NAME, "study")}
    assert list(named) == ["", "demo", "paper", "specialise", "aa"]
    assert "the last one took less than a minute" in named["demo"].text
    assert "judges the paper's claims" in named["paper"].text
    assert "80 jobs, 800 slices" in named["aa"].text
    assert page.find_element(By.NAME, "frames").is_displayed()
    named["demo"].click()
    until(page, lambda: not page.find_element(By.NAME, "frames").is_displayed())
    write(page, "named_size", "16")
    until(page, lambda: text_of(page, "count").startswith(f"{service.get('studies/1')['jobs_total']} jobs, "))
    submit(page)
    until(page, lambda: page.current_url.endswith("/studies/2"))
    assert service.get("studies/2")["name"] == "demo"
    with service.database.reading() as session:
        job = session.scalars(select(Job).where(Job.study_id == 2)).first()
        assert job is not None
        assert (job.request["size"], job.request["frames"]) == ([16, 16], 12)


def test_a_double_submit_is_one_study(page: Chrome, service: Service) -> None:
    page.get(f"{address(service)}/submit")
    until(page, lambda: text_of(page, "count") != "")
    page.execute_script("const form = document.forms[0]; form.requestSubmit(); form.requestSubmit()")
    until(page, lambda: page.current_url.endswith("/studies/1"))
    assert len([url for url in requested(page) if url.endswith("/api/v1/studies")]) == 2
    page.get(f"{address(service)}/submit")  # Loaded anew: a study of its own.
    until(page, lambda: text_of(page, "count") != "")
    submit(page)
    until(page, lambda: page.current_url.endswith("/studies/2"))
    assert {job["study"] for job in service.get("jobs")["jobs"]} == {1, 2}


def test_progress_and_the_time_left_are_shown_as_it_goes_on(page: Chrome, service: Service) -> None:
    asked = {"scenes": "cornell-box", "axes": {"traversal": "paper"}, "size": 16, "frames": 3, "rounds": 3}
    study = service.post("studies", name="mine", **asked)
    page.get(f"{address(service)}/studies/1")
    assert (text_of(page, "slices"), text_of(page, "left")) == ("0 of 12 slices", "")
    page.execute_script("window.mark = 'kept'")
    first, *others = [job["id"] for job in study["jobs"]]
    end_round(service, [first], 0, 90)
    until(page, lambda: text_of(page, "left") == "about 10 min left")
    end_round(service, others, 0, 90)
    end_round(service, [first], 1, 30)
    until(page, lambda: text_of(page, "left") == "about 4 min left")
    assert text_of(page, "slices") == "5 of 12 slices"
    assert page.execute_script("return window.mark") == "kept"
    page.get(f"{address(service)}/studies")
    assert "about 4 min left" in page.find_element(By.CSS_SELECTOR, "tbody tr").text
    page.get(f"{address(service)}/studies/1")
    assert text_of(page, "left") == "about 4 min left"
    page.find_element(By.CSS_SELECTOR, "[data-cancel]").click()
    until(page, lambda: (text_of(page, "state"), text_of(page, "left")) == ("done", ""))


def test_a_study_of_thousands_of_jobs_is_shown_by_scene(page: Chrome, service: Service) -> None:
    numbers = add_large(service, 3000)
    begun = time.monotonic()
    answer = service.client.get("/studies/1")
    print(f"3000 jobs: {len(answer.content):,} bytes in {time.monotonic() - begun:.2f} s")
    page.get(f"{address(service)}/studies/1")
    groups = page.find_elements(By.CSS_SELECTOR, "details.jobs")
    assert [group.get_attribute("open") for group in groups] == [None, None]
    assert [group.text for group in groups] == [
        "cornell-box 0 of 1500 jobs have ended",
        f"{HOSTILE} 0 of 1500 jobs have ended",
    ]
    end_job(service, numbers[0])
    until(page, lambda: "1 of 1500" in page.find_element(By.CSS_SELECTOR, "details.jobs").text)
    page.find_element(By.CSS_SELECTOR, "details.jobs summary").click()
    row = page.find_element(By.CSS_SELECTOR, f"tr[data-job='{numbers[0]}']")
    until(page, lambda: row.is_displayed() and "done" in row.text)
    assert page.find_elements(By.CSS_SELECTOR, "main img, main td b") == []


def test_only_the_paper_has_a_report(page: Chrome, service: Service) -> None:
    service.post("studies", name="paper", scenes="cornell-box", size=16)
    service.post("studies", name="mine", scenes="cornell-box", size=16)
    for number, reports in ((1, 1), (2, 0)):
        page.get(f"{address(service)}/studies/{number}")
        assert len(page.find_elements(By.CSS_SELECTOR, f"a[href='/studies/{number}/report']")) == reports


def test_what_was_left_out_is_told_by_reason_and_by_name(page: Chrome, service: Service) -> None:
    axes = {"traversal": "bvh-stack,kd-backtrack", "nodes": "f32,grid16,half"}
    service.post("studies", name="mine", scenes="cornell-box", size=16, axes=axes)
    page.get(f"{address(service)}/studies/1")
    (told,) = page.find_elements(By.CSS_SELECTOR, ".refused summary")
    assert told.text.startswith("2 combinations: a KD-tree's planes say")
    told.click()
    names = page.find_element(By.CSS_SELECTOR, ".refused details").text.splitlines()[1]
    assert names == "kd-backtrack fragment normal grid16; kd-backtrack fragment normal half"


@pytest.mark.parametrize("path", ["submit", "studies", "studies/1"])
def test_pages_fit_a_narrow_screen_and_name_their_controls(page: Chrome, service: Service, path: str) -> None:
    service.post("studies", name="mine", scenes="cornell-box", axes={"traversal": "paper", "sah": "3,1; 2,1"})
    with screen(page, 400):
        page.get(f"{address(service)}/{path}")
        until(page, lambda: fits(page))
        nameless = "return [...document.querySelectorAll('main input, main select, main button, main progress')]"
        nameless += ".filter(e => !e.labels?.length && !e.textContent.trim() && !e.ariaLabel).length"
        assert page.execute_script(nameless) == 0


def add_large(service: Service, count: int) -> list[int]:
    """A study of many jobs on two scenes, straight into the store; its jobs' ids."""
    variants = matrix({axis: AXES[axis] for axis in ("traversal", "method")})[0]
    scenes = ("cornell-box", HOSTILE)
    orders = [Order(Request(scenes[i * 2 // count], variants[i % len(variants)])) for i in range(count)]
    with service.database.writing() as session:
        study = add_study(session, "large", {}, [])
        return sorted({part.job_id for part in add_jobs(session, orders, study_id=study.id)})


def end_round(service: Service, jobs: list[int], round_index: int, seconds: float) -> None:
    """Let a round of jobs have been measured in so many seconds each."""
    begun = now()
    with service.database.writing() as session:
        for part in session.scalars(select(Slice).where(Slice.job_id.in_(jobs), Slice.round == round_index)):
            part.state, part.started_at, part.ended_at = "done", begun, begun + timedelta(seconds=seconds)
            change_state(session, part.job, "running", "on the stand-in")


def end_job(service: Service, number: int) -> None:
    with service.database.writing() as session:
        job = session.get_one(Job, number)
        for part in job.slices:
            part.state = "done"
        change_state(session, job, "done")


def address(service: Service) -> str:
    return str(service.client.base_url).rstrip("/")


def label_of(control: WebElement) -> WebElement:
    return control.find_element(By.XPATH, "..")


def tick(page: Chrome, name: str, value: str | None = None) -> None:
    choice = "" if value is None else f"[value='{value}']"
    box = page.find_element(By.CSS_SELECTOR, f"input[name='{name}']{choice}")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", box)
    box.click()


def write(page: Chrome, name: str, words: str) -> None:
    field = page.find_element(By.NAME, name)
    field.clear()
    field.send_keys(words)


def submit(page: Chrome) -> None:
    page.execute_script("arguments[0].click()", page.find_element(By.CSS_SELECTOR, "form button"))
