"""What tests of pages ask the browser: pages that load themselves anew are outlived, and what is wrong is seen."""

from __future__ import annotations

import pytest
from browsing import module_browser, text_of, until, watched
from httpx import URL
from selenium.common.exceptions import TimeoutException
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By

PAGE = "data:text/html,<p id=state>old<p id=hidden hidden>hidden"
ANEW = """
const old = document.getElementById("state");
if (old.textContent === "old") {
  old.insertAdjacentHTML("afterend", "<p id=state>new");
  document.implementation.createHTMLDocument().adoptNode(old);
}
"""
"""Leaves an element behind in a document without a window, as of a page that was loaded anew."""
browser = module_browser


def test_a_wait_outlives_an_element_of_another_document(browser: Chrome) -> None:
    browser.get(PAGE)

    def is_new() -> bool:
        found = browser.find_element(By.ID, "state")
        browser.execute_script(ANEW)
        return found.text == "new"

    until(browser, is_new)


def test_a_wait_ends(browser: Chrome) -> None:
    browser.get(PAGE)
    with pytest.raises(TimeoutException):
        until(browser, lambda: text_of(browser, "nothing"), seconds=0.1)


def test_what_is_hidden_has_no_text(browser: Chrome) -> None:
    browser.get(PAGE)
    assert (text_of(browser, "state"), text_of(browser, "hidden")) == ("old", "")


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ("console.error('alas')", "alas"),
        ("console.warn('alas')", "alas"),
        ("return fetch('http://localhost:9').catch(() => 0)", "{'localhost:9'}"),
    ],
)
def test_what_is_wrong_is_seen(browser: Chrome, script: str, told: str) -> None:
    browser.get(PAGE)
    with pytest.raises(AssertionError, match=told), watched(browser, URL("http://here")):
        browser.execute_script(script)


def test_the_page_before_is_not_heard(browser: Chrome) -> None:
    browser.get(PAGE)
    browser.execute_script("setInterval(() => console.error('alas'), 1)")
    with pytest.raises(AssertionError, match=r"\(\[\], set\(\)\)"), watched(browser, URL("http://here")):
        browser.execute_async_script("setTimeout(arguments[0], 100)")
