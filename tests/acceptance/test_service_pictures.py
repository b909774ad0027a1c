"""Pictures of jobs: from a real slice into the blobs, over HTTP, and on their page in a real browser."""

from __future__ import annotations

import gzip
import hashlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from browsing import choose, fits, is_dark, module_browser, running_browser, screen, until, watched
from pictured import add_job, counts, image, keep
from PIL import Image
from selenium.webdriver import ActionChains, Chrome, Keys
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select
from service_fakes import Service, document, running_service, wait_for

from renderer.bench import combine
from renderer.pictures.counts import METRICS
from renderer.request import Request
from server.settings import Settings
from server.slices import SliceRunner
from server.store.blobs import Blobs

HOSTILE = '<script>alert(1)</script><img src=x onerror="alert(2)"> & \'"'
SIZE = (64, 48)
SEEDS = {"first": 21, "second": 22, "small": 23}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Jobs 1 to 3 of forest, the third smaller; 4 without counts; 5 without a picture; 6 of a hostile scene."""
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        with running_service(folder) as running:
            _fill(running, Blobs(folder / "blobs"))
            yield running


def _fill(service: Service, blobs: Blobs) -> None:
    whole, rounds = document(Request("forest"), 1.0), service.folder / "rounds"

    def add(seed: int, size: tuple[int, int], counted: bool, **more: Any) -> None:
        named = keep(rounds, blobs, image(seed, size), counts(seed, size) if counted else None)
        add_job(service.database, whole, named, size=size, **more)

    add(SEEDS["first"], SIZE, True, traversal="bvh-parent-link")
    add(SEEDS["second"], SIZE, True, traversal="kd-backtrack")
    add(SEEDS["small"], (16, 16), True, traversal="bvh-stack")
    add(SEEDS["first"], SIZE, False, traversal="brute-force", scene="cornell-box")
    add_job(service.database, whole, None, scene="cornell-box")
    add(SEEDS["first"], SIZE, True, scene=HOSTILE)


def picture(service: Service, job: object, **params: Any) -> Any:
    answer = service.client.get(f"/api/v1/jobs/{job}/picture", params=params)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png"), answer.text
    return np.asarray(Image.open(io.BytesIO(answer.content)).convert("RGB"))


def test_a_measured_job_has_the_pictures_of_its_plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_BLOBS", str(tmp_path / "blobs"))
    with running_service(tmp_path) as service:
        service.post("jobs", scene="cornell-box", size="24", frames=2, rounds=2, check="none")
        runner = SliceRunner(service.database, Settings(), lambda: True)
        with service.working(runner, combine) as worker:
            wait_for(worker.is_idle, 120)
        result = service.get("jobs/1")["result"]
        names = result["pictures"]
        for kind, name in names.items():
            file = service.client.get(f"/api/v1/pictures/{name}")
            assert hashlib.sha256(file.content).hexdigest() == name, kind
        assert picture(service, 1).shape == (24, 24, 3)
        held = np.load(io.BytesIO(service.client.get(f"/api/v1/pictures/{names['counts']}").content))
        rays = result["rays"]["primary"] + result["rays"]["shadow"]
        assert held["nodes"].sum() / rays == pytest.approx(result["per_ray"]["nodes"])


def test_a_stored_file_is_served_as_what_it_is(service: Service) -> None:
    named = service.get("jobs/1")["result"]["pictures"]
    for kind, media in (("image", "image/png"), ("counts", "application/zip")):
        answer = service.client.get(f"/api/v1/pictures/{named[kind]}")
        assert hashlib.sha256(answer.content).hexdigest() == named[kind]
        assert answer.headers["content-type"] == media
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "immutable" in answer.headers["cache-control"]


def test_what_is_no_picture_is_not_served(service: Service) -> None:
    with Blobs(service.folder / "blobs").receiving() as incoming:
        incoming.write(b"<script>alert(1)</script>")
        other = Blobs(service.folder / "blobs").keep(incoming)
    (service.folder / "blobs/st").mkdir(exist_ok=True)  # a file where a blob of that name would be
    (service.folder / "blobs/st/stray.gz").write_bytes(gzip.compress(b"\x89PNG\r\n\x1a\n"))
    for name in (other, "0" * 64, "x", "stray", "..%2f..%2fetc", HOSTILE):
        answer = service.client.get(f"/api/v1/pictures/{name}")
        assert (answer.status_code, answer.headers["content-type"]) == (404, "application/problem+json"), name
        assert len(answer.json()["detail"]) < 300


def test_a_jobs_picture_is_what_was_rendered(service: Service) -> None:
    assert (picture(service, 1) == image(SEEDS["first"], SIZE)[::-1]).all()
    assert picture(service, 1, what="nodes", top=100).shape == (SIZE[1], SIZE[0], 3)
    assert picture(service, 1, width=16).shape == (12, 16, 3)
    above = (picture(service, 1, what="nodes", top=100) == (0x35, 0xE0, 0xFF)).all(axis=-1)
    assert (above == (counts(SEEDS["first"], SIZE)["nodes"] > 100)[::-1]).all()


def test_a_pair_shares_its_scale(service: Service) -> None:
    figures = service.get("pictures/compare?baseline=1&against=2&what=bytes")
    alone = picture(service, 1, what="bytes", top=figures["scale"]["top"])
    assert (picture(service, 1, what="bytes", against=2) == alone).all()


def test_a_difference_is_amplified_as_stated(service: Service) -> None:
    figures = service.get("pictures/compare?baseline=1&against=2")["difference"]
    one, other = (image(SEEDS[name], SIZE).astype(int)[::-1] for name in ("first", "second"))
    drawn = picture(service, 1, against=2, view="difference")
    assert (drawn == np.abs(one - other) * figures["amplified"]).all()
    assert (picture(service, 1, against=1, view="difference") == 0).all()
    assert picture(service, 1, against=2, view="difference", what="nodes").shape == drawn.shape


@pytest.mark.parametrize("what", list(METRICS))
def test_the_figures_are_those_of_the_counts(service: Service, what: str) -> None:
    view = service.get(f"pictures/compare?baseline=1&against=2&what={what}")
    for side, name in (("baseline", "first"), ("against", "second")):
        counted = counts(SEEDS[name], SIZE)[what]
        found = [view[side][key] for key in ("mean", "p50", "p99", "max")]
        assert found == pytest.approx([counted.mean(), *np.percentile(counted, [50, 99]), counted.max()])
        assert view[side]["size"] == list(SIZE)
    change = counts(SEEDS["second"], SIZE)[what] - counts(SEEDS["first"], SIZE)[what]
    assert view["difference"]["differing_share"] == pytest.approx((change != 0).mean())
    assert (view["difference"]["largest"], view["difference"]["flip"]) == (np.abs(change).max(), None)


def test_identical_images_have_no_psnr(service: Service) -> None:
    change = service.get("pictures/compare?baseline=1&against=4")["difference"]
    assert (change["identical"], change["psnr_db"], change["differing_share"]) == (True, None, 0.0)


def test_the_same_again_is_not_drawn_again(service: Service) -> None:
    address = "/api/v1/jobs/1/picture?what=nodes"
    first = service.client.get(address)
    again = service.client.get(address, headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    other = service.client.get(f"{address}&top=9", headers={"If-None-Match": first.headers["etag"]})
    assert other.status_code == 200


@pytest.mark.parametrize(
    ("address", "status", "said"),
    [
        ("jobs/99/picture", 404, "There is no job 99"),
        ("jobs/5/picture", 404, "Job 5 has no picture"),
        ("jobs/4/picture?what=nodes", 404, "Job 4 has no counts"),
        ("jobs/1/picture?what=depth", 422, "Unknown what 'depth'"),
        ("jobs/1/picture?view=difference", 422, "name the other with against=JOB"),
        ("jobs/1/picture?what=nodes&top=0", 422, "top is wrong"),
        ("jobs/1/picture?width=100000", 422, "width is wrong"),
        ("jobs/1/picture?view=difference&against=3", 422, "64x48 and 16x16 pixels: choose two of one size"),
        ("pictures/compare?baseline=1&against=3&what=nodes", 422, "64x48 and 16x16 pixels: choose two of one size"),
        ("pictures/compare?baseline=1&against=x", 404, "There is no job x"),
        ("pictures/compare?baseline=1", 422, "against is missing"),
    ],
)
def test_the_api_refuses_in_one_sentence(service: Service, address: str, status: int, said: str) -> None:
    answer = service.client.get(f"/api/v1/{address}")
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert said in answer.json()["detail"]


def test_a_lost_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAYFARM_BLOBS", str(tmp_path / "blobs"))
    with running_service(tmp_path) as service:
        named = keep(tmp_path / "round", Blobs(tmp_path / "blobs"), image(1), counts(1))
        for _ in range(2):
            add_job(service.database, document(Request("forest"), 1.0), named)
        for path in (tmp_path / "blobs").rglob("*.gz"):
            path.unlink()
        answer = service.client.get("/api/v1/jobs/1/picture")
        assert (answer.status_code, "set RAYFARM_BLOBS" in answer.json()["detail"]) == (503, True)
        page = service.client.get("/pictures", headers={"accept": "text/html"})
        assert (page.status_code, "set RAYFARM_BLOBS" in page.text) == (200, True)
        assert service.client.get(f"/api/v1/pictures/{named['image']}").status_code == 404


def test_a_service_without_pictures_says_so(tmp_path: Path) -> None:
    with running_service(tmp_path) as service:
        page = service.client.get("/pictures", headers={"accept": "text/html"})
    assert (page.status_code, "No job has a picture yet" in page.text) == (200, True)


# The page, in a browser.


browser = module_browser


@pytest.fixture
def page(browser: Chrome, service: Service) -> Iterator[Chrome]:
    """The browser on the page of pictures; afterwards nothing was refused, logged, popped up or fetched elsewhere."""
    with watched(browser, service.client.base_url):
        _open(browser, service, "/pictures?scene=forest&baseline=1&against=2&what=nodes")
        yield browser


def test_the_default_is_the_newest_pair_of_one_size(page: Chrome, service: Service) -> None:
    _open(page, service, "/pictures?scene=forest")
    assert _chosen(page) == {"scene": "forest", "baseline": "1", "against": "2", "what": "image", "view": "slider"}


def test_all_pictures_are_drawn(page: Chrome, service: Service) -> None:
    for view in ("slider", "side", "difference", "all"):
        for what in ("image", *METRICS):
            _open(page, service, f"/pictures?scene=forest&baseline=1&against=2&what={what}&view={view}")
            widths = page.execute_script("return [...document.images].map(image => image.naturalWidth)")
            assert len(widths) == {"slider": 2, "side": 2, "difference": 1, "all": 3}[view]
            assert min(widths) > 0
            assert all(image.get_attribute("alt") for image in page.find_elements(By.TAG_NAME, "img"))


def test_both_pictures_lie_over_each_other_pixel_by_pixel(page: Chrome) -> None:
    boxes = [image.rect for image in page.find_elements(By.CSS_SELECTOR, ".stage img")]
    assert boxes[0] == boxes[1]
    assert boxes[0]["width"] / boxes[0]["height"] == pytest.approx(SIZE[0] / SIZE[1], rel=0.01)


def test_the_slider_is_dragged_on_the_picture(page: Chrome) -> None:
    stage = page.find_element(By.CSS_SELECTOR, ".stage .edge")
    assert _cut(page) == (50, "50%")
    width = stage.rect["width"]
    ActionChains(page).move_to_element_with_offset(stage, int(width * 0.1), 5).click_and_hold().move_by_offset(
        int(-width * 0.4), 7
    ).release().perform()
    value, drawn = _cut(page)
    assert value == pytest.approx(20, abs=2)
    assert drawn == f"{value}%"
    assert parse_qs(urlsplit(page.current_url).query)["cut"] == [str(value)]
    clip = page.find_element(By.CSS_SELECTOR, ".against img").value_of_css_property("clip-path")
    assert f"{value}%" in clip
    page.get(page.current_url)
    assert _cut(page) == (value, f"{value}%")


def test_the_slider_is_moved_by_keys(page: Chrome) -> None:
    slider = page.find_element(By.ID, "cut")
    assert slider.accessible_name.startswith("Cut")
    slider.send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT)
    assert _cut(page) == (48, "48%")
    assert slider.get_attribute("aria-valuetext") == "48 % baseline, 52 % against"
    slider.send_keys(Keys.END)
    assert _cut(page) == (100, "100%")
    slider.send_keys(Keys.HOME)
    assert _cut(page) == (0, "0%")
    assert parse_qs(urlsplit(page.current_url).query)["cut"] == ["0"]


def test_the_address_is_the_state(page: Chrome) -> None:
    choose(page, "view", "difference")
    caption = page.find_element(By.CSS_SELECTOR, ".apart figcaption").text
    assert "Job 2 minus job 1" in caption
    numbers = [each.text for each in page.find_elements(By.CSS_SELECTOR, ".scale .numbers li")]
    assert [numbers[0][0], numbers[1], numbers[2][0]] == ["−", "0", "+"]
    before = _chosen(page), page.find_element(By.TAG_NAME, "main").text
    page.get(page.current_url)
    assert (_chosen(page), page.find_element(By.TAG_NAME, "main").text) == before
    choose(page, "what", "image")
    assert "times as bright" in page.find_element(By.CSS_SELECTOR, ".apart figcaption").text


def test_another_scene_chooses_its_own_jobs(page: Chrome) -> None:
    choose(page, "scene", "cornell-box")
    assert parse_qs(urlsplit(page.current_url).query).get("baseline") is None
    assert _chosen(page)["baseline"] == "4"
    assert "is the only one" in page.find_element(By.TAG_NAME, "main").text


def test_the_figures_stand_in_the_table(page: Chrome, service: Service) -> None:
    view = service.get("pictures/compare?baseline=1&against=2&what=nodes")
    rows = [row.text for row in page.find_elements(By.CSS_SELECTOR, "tbody tr")]
    for row, side in zip(rows, ("baseline", "against"), strict=True):
        assert f"{view[side]['mean']:,.1f}" in row
        assert "64x48" in row
    assert "Mean against baseline" in page.find_element(By.TAG_NAME, "caption").text
    numbers = [each.text for each in page.find_elements(By.CSS_SELECTOR, ".scale .numbers li")]
    assert (numbers[0], numbers[-1]) == ("0", f"{view['scale']['top']:,}")


def test_all_heatmaps_of_a_scene_share_one_scale(page: Chrome, service: Service) -> None:
    _open(page, service, "/pictures?scene=forest&what=nodes&view=all")
    captions = [each.text for each in page.find_elements(By.CSS_SELECTOR, ".sheet figcaption")]
    assert len(captions) == 3
    assert all("mean" in caption for caption in captions)
    tops = {parse_qs(urlsplit(each.get_attribute("src") or "").query)["top"][0] for each in _images(page)}
    assert len(tops) == 1
    assert page.find_elements(By.NAME, "baseline") == []


def test_two_sizes_stand_side_by_side_with_a_sentence(page: Chrome, service: Service) -> None:
    _open(page, service, "/pictures?baseline=1&against=3")
    assert "64x48 and 16x16 pixels: choose two of one size" in page.find_element(By.CSS_SELECTOR, ".note").text
    assert len(_images(page)) == 2
    assert page.find_elements(By.ID, "cut") == []


def test_what_was_not_counted_says_so(page: Chrome, service: Service) -> None:
    _open(page, service, "/pictures?baseline=1&against=4&what=nodes&view=difference")
    notes = [note.text for note in page.find_elements(By.CSS_SELECTOR, ".note")]
    assert any("Job 4 has no counts" in note for note in notes)
    assert "not counted" in page.find_element(By.CSS_SELECTOR, "figure.against").text
    assert len(_images(page)) == 1


def test_hostile_names_stay_text(page: Chrome, service: Service) -> None:
    _open(page, service, "/pictures?baseline=6&against=1")
    assert HOSTILE in page.find_element(By.TAG_NAME, "h1").text
    assert page.find_elements(By.CSS_SELECTOR, "main script, main img[src='x']") == []
    assert HOSTILE in [option.text for option in Select(page.find_element(By.NAME, "scene")).options]
    assert "different scenes" in page.find_element(By.CSS_SELECTOR, ".note").text


@pytest.mark.parametrize("width", [400, 1400])
def test_the_page_fits_and_is_dark_where_asked(page: Chrome, service: Service, width: int) -> None:
    with screen(page, width, "dark"):
        for view in ("slider", "side", "difference", "all"):
            _open(page, service, f"/pictures?baseline=1&against=2&what=nodes&view={view}")
            assert fits(page)
            assert is_dark(page)


def test_without_scripts_both_stand_side_by_side(service: Service, tmp_path: Path) -> None:
    with running_browser(tmp_path, scripts=False) as chrome:
        _open(chrome, service, "/pictures?baseline=1&against=2")
        left, right = (image.rect for image in _images(chrome))
        assert left["x"] + left["width"] <= right["x"]
        assert not chrome.find_element(By.ID, "cut").is_displayed()
        Select(chrome.find_element(By.NAME, "view")).select_by_value("difference")
        chrome.find_element(By.CSS_SELECTOR, "#controls button").click()
        until(chrome, lambda: "view=difference" in chrome.current_url)
        assert len(_images(chrome)) == 1


def _open(chrome: Chrome, service: Service, address: str) -> None:
    """Open a page and wait for its pictures: on a busy machine the driver may be back before them."""
    chrome.get(f"{service.client.base_url}{address}")
    whole = "return document.readyState === 'complete' && [...document.images].every(image => image.complete)"
    until(chrome, lambda: chrome.execute_script(whole))


def _images(chrome: Chrome) -> list[Any]:
    return chrome.find_elements(By.CSS_SELECTOR, "main img")


def _cut(page: Chrome) -> tuple[int, str]:
    """Where the slider is, and where the picture is cut."""
    value = page.find_element(By.ID, "cut").get_property("value")
    drawn = page.execute_script("return document.querySelector('.stage').style.getPropertyValue('--cut')")
    return int(cast(str, value)), drawn


def _chosen(page: Chrome) -> dict[str, str]:
    chosen = {
        str(each.get_attribute("name")): str(Select(each).first_selected_option.get_attribute("value"))
        for each in page.find_elements(By.TAG_NAME, "select")
    }
    return {name: value for name, value in chosen.items() if value}
