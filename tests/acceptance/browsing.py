"""A headless Chromium for tests of pages, and what these ask of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

import pytest
from httpx import URL
from selenium.common.exceptions import WebDriverException
from selenium.webdriver import Chrome, ChromeOptions
from selenium.webdriver.chrome.service import Service as Driver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1400,1300",
)


@contextmanager
def running_browser(folder: Path, scripts: bool = True) -> Iterator[Chrome]:
    """A browser that keeps its profile in `folder`, with or without JavaScript."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("chromium and chromedriver are not installed: apt install chromium chromium-driver")
    options = ChromeOptions()
    options.binary_location = chromium
    for switch in (*SWITCHES, f"--user-data-dir={folder}"):
        options.add_argument(switch)
    if not scripts:
        options.add_experimental_option("prefs", {"profile.managed_default_content_settings.javascript": 2})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with Chrome(options=options, service=Driver(driver)) as chrome:
        yield chrome


@pytest.fixture(scope="module")
def module_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    """One browser for a module's tests, where the module says `browser = module_browser`."""
    with running_browser(tmp_path_factory.mktemp("chromium")) as chrome:
        yield chrome


def until(browser: Chrome, condition: Callable[[], object], seconds: float = 30) -> None:
    # A page that loads itself anew leaves what was found in it behind; chromedriver has several errors for that.
    WebDriverWait(browser, seconds, ignored_exceptions=[WebDriverException]).until(lambda _: condition())


@contextmanager
def screen(browser: Chrome, width: int, scheme: str = "light", *, mobile: bool = False) -> Iterator[None]:
    """While it lasts pages are shown in a width of pixels and a colour scheme."""
    set_screen(browser, width, scheme, mobile=mobile)
    try:
        yield
    finally:
        reset_screen(browser)


def set_screen(browser: Chrome, width: int, scheme: str = "light", *, mobile: bool = False) -> None:
    size = {"width": width, "height": 1200, "deviceScaleFactor": 1, "mobile": mobile}
    feature = {"name": "prefers-color-scheme", "value": scheme}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": [feature]})


def reset_screen(browser: Chrome) -> None:
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


def fits(browser: Chrome) -> bool:
    """Whether nothing must be scrolled sideways."""
    return bool(browser.execute_script("return document.documentElement.scrollWidth <= innerWidth"))


def is_dark(browser: Chrome) -> bool:
    return browser.find_element(By.TAG_NAME, "body").value_of_css_property("background-color") == "rgba(20, 25, 27, 1)"


def wait_for_chart(browser: Chrome) -> None:
    until(browser, lambda: browser.find_element(By.ID, "chart").get_attribute("data-drawn") == "yes")


def choose(browser: Chrome, name: str, value: str) -> None:
    """Choose from a list whose change leads to another address."""
    before = browser.current_url
    Select(browser.find_element(By.NAME, name)).select_by_value(value)
    until(browser, lambda: browser.current_url != before)


def text_of(browser: Chrome, name: str) -> str:
    """What the element of an id shows, found and read in one document, though the page may load itself anew."""
    read = "const it = document.getElementById(arguments[0]); return it.checkVisibility() ? it.innerText : ''"
    return str(browser.execute_script(read, name)).strip()


def log(browser: Chrome, kind: str) -> list[dict[str, Any]]:
    """What was logged since the last look."""
    entries: list[dict[str, Any]] = cast(Any, browser).get_log(kind)
    return entries


def requested(browser: Chrome) -> list[str]:
    """The addresses asked for since the last look."""
    messages = [json.loads(entry["message"])["message"] for entry in log(browser, "performance")]
    return [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]


def wrong(browser: Chrome) -> list[str]:
    return [entry["message"] for entry in log(browser, "browser") if entry["level"] in ("SEVERE", "WARNING")]


@contextmanager
def watched(browser: Chrome, base_url: URL) -> Iterator[Chrome]:
    """While it lasts nothing is logged as wrong, and of all hosts `base_url`'s alone is asked."""
    browser.get("about:blank")  # What was open before still asks its own host.
    log(browser, "performance")
    log(browser, "browser")
    yield browser
    hosts = {urlsplit(url).netloc for url in requested(browser) if url.startswith(("http:", "https:", "ws"))}
    found = wrong(browser), hosts
    assert found == ([], {urlsplit(str(base_url)).netloc}), found
