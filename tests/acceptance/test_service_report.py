"""The report in a browser: from a file with no network, and from a service's stored results."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from browsing import fits, log, module_browser, requested, reset_screen, set_screen, until, wrong
from paper_documents import World, with_pictures
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from service_fakes import Service, running_service

from renderer.build.tree import SahCosts
from renderer.request import Request
from renderer.variant import Variant
from server.paper.claims import CLAIMS
from server.paper.report import pictures_in, write_report
from server.store.blobs import Blobs
from server.store.records import Order, add_jobs, add_result, add_study

HOSTILE = '<script>document.title="taken"</script><img src=x onerror="alert(2)">'
WIDTHS = (1400, 400)
Json = dict[str, Any]
browser = module_browser


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pictures")


@pytest.fixture(scope="module")
def documents(pictures: Path) -> list[Json]:
    device = {"id": "phone", "kind": "phone", "name": HOSTILE, "driver": "V@1"}
    world = World(
        time=lambda cell: 0.7 if cell.method == "hybrid" else 1.0, clock="wall", change=with_pictures(pictures)
    )
    return [document | {"device": device} for document in world.documents()]


@pytest.fixture(scope="module")
def report(documents: list[Json], pictures: Path) -> Path:
    path = pictures / "report.html"
    write_report(documents, pictures_in(pictures), path)
    return path


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory, documents: list[Json], pictures: Path) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        blobs = Blobs(folder / "blobs")
        for path in pictures.glob("*.[np][pn][zg]"):
            with blobs.receiving() as incoming:
                incoming.write(path.read_bytes())
                assert blobs.keep(incoming) == path.stem
        with running_service(folder) as running:
            _store(running, documents)
            yield running


def _store(service: Service, documents: list[Json]) -> None:
    """Study 1 has the results, study 2 none."""
    with service.database.writing() as session:
        study = add_study(session, HOSTILE, {}, [])
        for document in documents:
            variant = Variant(document["traversal"], document["method"], document["layout"], box="williams")
            sah = SahCosts(document["sah"]["traversal"], document["sah"]["intersection"])
            request = Request(document["scene"], variant, frames=1, rounds=1, costs=sah)
            [part] = add_jobs(session, [Order(request)], study_id=study.id)
            part.state = part.job.state = "done"
            add_result(session, part.job, document)
        add_study(session, "empty", {}, [])


@pytest.fixture
def page(browser: Chrome) -> Iterator[Chrome]:
    """A browser; afterwards nothing was logged as wrong."""
    log(browser, "performance")
    log(browser, "browser")
    yield browser
    assert wrong(browser) == []
    reset_screen(browser)
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", _network(offline=False))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_file_opens_without_a_network(page: Chrome, report: Path, scheme: str, width: int) -> None:
    _open(page, report.as_uri(), scheme, width, offline=True)
    assert _requested(page) == {report.as_uri()}
    assert page.title != "taken"
    assert HOSTILE in page.find_element(By.TAG_NAME, "main").text
    assert len(page.find_elements(By.CSS_SELECTOR, ".claims tbody tr")) == len(CLAIMS)
    assert len(page.find_elements(By.CSS_SELECTOR, "figure.figure")) == 9
    assert page.execute_script("return [...document.images].every(i => i.complete && i.naturalWidth > 0)")
    assert fits(page)


@pytest.mark.parametrize("width", WIDTHS)
def test_charts_can_be_read(page: Chrome, report: Path, width: int) -> None:
    """Their text is at least 9 pixels high on the screen and none leaves its chart."""
    _open(page, report.as_uri(), "light", width)
    sizes = page.execute_script(
        """return [...document.querySelectorAll("svg.chart")].map(chart => {
             const box = chart.getBoundingClientRect(), scale = box.width / chart.viewBox.baseVal.width
             return [...chart.querySelectorAll("text")].map(text => {
               const own = text.getBoundingClientRect()
               return [parseFloat(getComputedStyle(text).fontSize) * scale, own.right - box.right, box.left - own.left]
             })
           })"""
    )
    assert len(sizes) > 9
    for size, right, left in (text for chart in sizes for text in chart):
        assert size >= 9
        assert max(right, left) <= 1


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_charts_follow_light_and_dark(page: Chrome, report: Path, scheme: str) -> None:
    _open(page, report.as_uri(), scheme, 1400)
    text, card = page.execute_script(
        """const text = document.querySelector("svg.chart text"), card = document.querySelector(".figure")
           return [getComputedStyle(text).fill, getComputedStyle(card).backgroundColor]"""
    )
    assert (_light(text) < 80 and _light(card) > 200) if scheme == "light" else _light(text) > 200 > 80 > _light(card)


def test_a_claim_leads_to_its_reasoning_and_its_figure(page: Chrome, report: Path) -> None:
    _open(page, report.as_uri(), "light", 1400)
    row = page.find_element(By.CSS_SELECTOR, ".claims tbody tr")
    assert "holds" in row.text
    row.find_element(By.CSS_SELECTOR, "a.outcome").click()
    assert page.current_url.endswith("#s1-claim-hybrid-beats-fragment")
    article = page.find_element(By.CSS_SELECTOR, "article:target")
    assert "geometric mean over 12 cells" in article.text
    article.find_element(By.LINK_TEXT, "Figure 3").click()
    assert page.find_element(By.CSS_SELECTOR, "figure:target h4").text.startswith("Figure 3")


def test_it_prints(page: Chrome, report: Path) -> None:
    _open(page, report.as_uri(), "dark", 1400)
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": []})
    assert _light(page.execute_script("return getComputedStyle(document.body).backgroundColor")) == 255
    assert len(page.execute_cdp_cmd("Page.printToPDF", {})["data"]) > 50_000


def test_the_service_shows_it_and_offers_it_as_a_file(page: Chrome, service: Service) -> None:
    base = str(service.client.base_url)
    _open(page, f"{base}/studies/1/report", "light", 1400)
    assert {urlsplit(url).netloc for url in _requested(page) if url.startswith("http")} == {urlsplit(base).netloc}
    assert page.title != "taken"
    assert HOSTILE in page.find_element(By.TAG_NAME, "h1").text
    assert len(page.find_elements(By.CSS_SELECTOR, ".maps img")) == 4
    link = page.find_element(By.LINK_TEXT, "Download this report")
    answer = httpx.get(str(link.get_attribute("href")), trust_env=False, timeout=60)
    assert answer.headers["content-disposition"] == 'attachment; filename="rayfarm-study-1.html"'
    assert "Back to the study" not in answer.text
    assert answer.text.count("data:image/png;base64,") >= 5
    page.find_element(By.LINK_TEXT, "Back to the study").click()
    until(page, lambda: page.current_url == f"{base}/studies/1")


def test_the_claims_as_json(service: Service) -> None:
    view = service.get("studies/1/claims")
    assert [claim["id"] for claim in view["claims"]] == [claim.key for claim in CLAIMS]
    assert view["claims"][0]["outcome"] == "holds"
    assert view["claims"][0]["device"]["device"] == "phone"


@pytest.mark.parametrize("path", ["/api/v1/studies/{}/claims", "/studies/{}/report"])
@pytest.mark.parametrize(("study", "words"), [("2", "no results yet"), ("9", "no study 9"), ("x", "no study x")])
def test_without_results_it_says_so(service: Service, path: str, study: str, words: str) -> None:
    answer = service.client.get(path.format(study))
    assert answer.status_code == 404
    assert words in answer.json()["detail"]


def _open(page: Chrome, url: str, scheme: str, width: int, offline: bool = False) -> None:
    page.execute_cdp_cmd("Network.enable", {})
    page.execute_cdp_cmd("Network.emulateNetworkConditions", _network(offline=offline))
    set_screen(page, width, scheme)
    page.get("about:blank")  # An address that differs in its fragment alone would not load again.
    page.get(url)


def _network(*, offline: bool) -> Json:
    return {"offline": offline, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}


def _light(colour: str) -> float:
    """The mean of a computed colour's channels, 0 to 255."""
    channels = [float(part) for part in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    return sum(channels) / 3


def _requested(browser: Chrome) -> set[str]:
    """The addresses asked for since the last look, but for those that hold their content."""
    return {url for url in requested(browser) if not url.startswith(("data:", "about:"))}
