"""The pages of scenes, over HTTP and in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from html import unescape
from urllib.parse import quote

import httpx
import pytest
from browsing import fits, is_dark, module_browser, screen, watched
from pictured import add_job, counts, image, keep
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from service_fakes import Service, document, running_service

from renderer.request import Request
from scenes.catalogue import ENTRIES
from server.store.blobs import Blobs

HOSTILE = '<script>alert(1)</script>/../<img src=x onerror="alert(2)"> & ?#%'
browser = module_browser


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """One picture of forest, one of a sized forest, one of a hostile name, and a result without one."""
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        patch.setenv("RAYFARM_SCENES", str(folder))
        patch.setenv("XDG_CACHE_HOME", str(folder))
        with running_service(folder) as running:
            named = keep(folder / "round", Blobs(folder / "blobs"), image(1), counts(1))
            whole = document(Request("forest"), 1.0)
            for scene, pictures in (("forest", named), ("forest:5000", named), (HOSTILE, named), ("cornell-box", None)):
                add_job(running.database, whole, pictures, scene=scene)
            yield running


def read(service: Service, address: str) -> httpx.Response:
    return service.client.get(address, headers={"accept": "text/html"})


def test_every_scene_is_listed_with_its_facts(service: Service) -> None:
    page = unescape(read(service, "/scenes").text)
    for entry in ENTRIES.values():
        for fact in (entry.title, f"{entry.triangles:,}", entry.licence, entry.source, f"/scenes/{entry.name}"):
            assert fact in page, (entry.name, fact)
    assert "no: run rayfarm scenes fetch stanford-bunny" in page


@pytest.mark.parametrize("name", list(ENTRIES))
def test_every_scene_has_a_page(service: Service, name: str) -> None:
    answer, entry = read(service, f"/scenes/{name}"), ENTRIES[name]
    page = unescape(answer.text)
    assert (answer.status_code, entry.source in page, entry.licence in page, entry.get in page) == (200,) + (True,) * 3
    assert (f"/submit?scenes={name}" in page) == bool(entry.made)
    if entry.camera is not None:
        assert f"{entry.camera.fov:g}°" in page


def test_a_sized_scene_has_its_own_count_picture_and_results(service: Service) -> None:
    page = unescape(read(service, "/scenes/forest:5000").text)
    for part in (
        "5,000",
        "/api/v1/jobs/2/picture",
        "/?scene=forest%3A5000&cols=device",
        "/submit?scenes=forest%3A5000",
    ):
        assert part in page
    assert "It has not been measured here yet" in read(service, "/scenes/forest:7000").text
    assert "Its results have no picture" in read(service, "/scenes/cornell-box").text


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nothing", "There is no scene 'nothing'"),
        ("forest:x", "needs a whole number"),
        ("forest:999999999999999", "needs a whole number"),
        ("cornell-box:5", "fixed triangle count"),
        ("../../etc/passwd", "There is no scene"),
        ("<script>alert(1)</script>", "There is no scene"),
        ("x" * 5000, "There is no scene"),
    ],
)
def test_a_name_that_is_no_scene_is_told(service: Service, name: str, said: str) -> None:
    answer = read(service, f"/scenes/{quote(name, safe='')}")
    assert (answer.status_code, said in unescape(answer.text)) == (404, True)
    assert "<script>alert" not in answer.text


def test_the_links_of_a_scene_lead_to_its_results(service: Service) -> None:
    answer = read(service, "/?scene=forest%3A5000&cols=device")
    assert (answer.status_code, "/jobs/2" in answer.text) == (200, True)
    answer = read(service, "/pictures?scene=forest%3A5000")
    assert (answer.status_code, "/api/v1/jobs/2/picture" in answer.text) == (200, True)


def test_the_pages_show_pictures_and_hostile_names_stay_text(service: Service, browser: Chrome) -> None:
    with watched(browser, service.client.base_url):
        browser.get(f"{service.client.base_url}/scenes")
        assert browser.find_element(By.CSS_SELECTOR, "nav [aria-current]").text == "Scenes"
        assert len(browser.find_elements(By.CSS_SELECTOR, ".thumb img")) == 1
        names = browser.find_elements(By.CSS_SELECTOR, ".names a")
        assert {link.text for link in names} == {HOSTILE, "forest:5000"}
        next(link for link in names if link.text == HOSTILE).click()
        assert browser.find_element(By.TAG_NAME, "h1").text == HOSTILE
        assert browser.find_elements(By.CSS_SELECTOR, "main script, main img[src='x']") == []
        assert browser.execute_script("return document.images[0].naturalWidth") == 64
        browser.find_element(By.LINK_TEXT, "Pictures of this scene").click()
        assert HOSTILE in browser.find_element(By.TAG_NAME, "h1").text


@pytest.mark.parametrize("address", ["scenes", "scenes/forest", "scenes/fairy-forest", f"scenes/{quote(HOSTILE)}"])
@pytest.mark.parametrize("width", [400, 1400])
def test_the_pages_fit_and_are_dark_where_asked(service: Service, browser: Chrome, address: str, width: int) -> None:
    with screen(browser, width, "dark"):
        browser.get(f"{service.client.base_url}/{address}")
        assert fits(browser)
        assert is_dark(browser)
