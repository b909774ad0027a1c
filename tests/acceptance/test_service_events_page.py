"""The pages' progress in headless Chromium: shown as it happens, over a restart, and without JavaScript."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from browsing import module_browser, requested, running_browser, text_of, until
from event_service import EventService, running_events, wait_until
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By

HOSTILE = '<img src=x onerror="alert(1)"> & <b>bold</b>'
browser = module_browser


@pytest.fixture
def service(tmp_path: Path) -> Iterator[EventService]:
    with running_events(f"sqlite:///{tmp_path / 'x.sqlite'}") as running:
        yield running


def test_a_studys_page_shows_what_happens(service: EventService, browser: Chrome) -> None:
    first, second = service.add(2, study=True)
    open_page(browser, f"{service.base}/studies/1")
    service.change(first, "running", reason=HOSTILE)
    until(browser, lambda: row(browser, first) == ("running", HOSTILE))
    service.change(first, "done")
    until(browser, lambda: text_of(browser, "slices") == "2 of 4 slices")
    assert browser.execute_script("return window.mark") == "kept"  # It was not loaded anew.
    assert row(browser, second) == ("queued", "")
    service.change(second, "done")
    until(browser, lambda: browser.execute_script("return window.mark") is None)
    until(browser, lambda: (text_of(browser, "state"), text_of(browser, "slices")) == ("done", "4 of 4 slices"))
    streams = [url for url in requested(browser) if "/events" in url]
    assert streams == [f"{service.base}/api/v1/studies/1/events?after=2"]
    wait_until(lambda: not service.feed.is_polling)


def test_a_jobs_page_goes_on_after_a_restart(service: EventService, browser: Chrome) -> None:
    (job,) = service.add()
    service.change(job, "preparing")
    open_page(browser, f"{service.base}/jobs/{job}")
    service.change(job, "running", reason=HOSTILE)
    until(browser, lambda: text_of(browser, "reason") == HOSTILE)
    service.stop()
    service.change(job, "waiting", reason="The phone is away.")
    service.start()
    until(browser, lambda: text_of(browser, "state") == "waiting")
    assert browser.execute_script("return window.mark") == "kept"
    shown = [entry.text.split(" ", 2)[2] for entry in browser.find_elements(By.CSS_SELECTOR, ".history li")]
    assert shown == ["queued", "preparing", f"running {HOSTILE}", "waiting The phone is away."]
    assert browser.find_elements(By.CSS_SELECTOR, ".history img, .history b") == []


def test_a_page_of_the_past_listens_to_nothing(service: EventService, browser: Chrome) -> None:
    (job,) = service.add()
    service.change(job, "done")
    open_page(browser, f"{service.base}/jobs/{job}")
    assert text_of(browser, "state") == "done"
    assert [url for url in requested(browser) if "/events" in url] == []


def test_without_scripts_the_page_loads_itself(service: EventService, tmp_path: Path) -> None:
    (job,) = service.add()
    with running_browser(tmp_path / "chromium", scripts=False) as browser:
        browser.get(f"{service.base}/jobs/{job}")
        assert text_of(browser, "state") == "queued"
        service.change(job, "done")
        until(browser, lambda: text_of(browser, "state") == "done")
        assert browser.find_elements(By.CSS_SELECTOR, "meta[http-equiv=refresh]") == []


def open_page(browser: Chrome, url: str) -> None:
    browser.get("about:blank")  # The page of the test before still asks its own service.
    requested(browser)
    browser.get(url)
    browser.execute_script("window.mark = 'kept'")


def row(browser: Chrome, job: int) -> tuple[str, str]:
    found = browser.find_element(By.CSS_SELECTOR, f"tr[data-job='{job}']")
    return found.find_element(By.CLASS_NAME, "state").text, found.find_element(By.CLASS_NAME, "reason").text
