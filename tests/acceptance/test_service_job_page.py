"""A job's page in headless Chromium: what it says, its frames drawn, profiles imported, and its raw data over HTTP."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest
from browsing import fits, log, module_browser, screen, text_of, until, wait_for_chart, watched
from job_documents import FRAMES, ROUNDS, add_measured, document_of, request_of
from selenium.webdriver import Chrome
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from service_fakes import Service, running_service
from trace_rules import assert_rules, spans

from server.store.models import Device, Job
from server.store.records import Order, add_jobs, add_result, change_state

FIXTURES = Path(__file__).parents[1] / "fixtures" / "profiles"
HOSTILE = '<img src=x onerror="alert(1)"> & <b>"bold"</b>'
NAMELESS = "button, input, select, textarea, a, summary"
browser = module_browser


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        patch.setenv("RAYFARM_PROFILE_MB", "1")
        with running_service(folder) as running:
            yield running


@pytest.fixture(scope="module")
def twin(service: Service) -> int:
    return add_measured(service.database, phone=False)


@pytest.fixture(scope="module")
def phone(service: Service) -> int:
    return add_measured(service.database, phone=True)


@pytest.fixture
def page(browser: Chrome, service: Service) -> Iterator[Chrome]:
    """The browser; afterwards nothing was refused, logged, popped up or fetched elsewhere."""
    with watched(browser, service.client.base_url):
        yield browser


def open_job(page: Chrome, service: Service, job: int) -> None:
    page.get(f"{service.client.base_url}/jobs/{job}")


def main_text(page: Chrome) -> str:
    return str(page.find_element(By.TAG_NAME, "main").text)


def points(page: Chrome) -> dict[str, int]:
    """The number of points that the chart has, by the trace's name."""
    script = """return Object.fromEntries(document.getElementById("chart")._fullData.map((trace, i) =>
        [trace.name, document.querySelectorAll("#chart .scatterlayer .trace")[i].querySelectorAll(".point").length]))"""
    return cast(dict[str, int], page.execute_script(script))


def test_the_headline_says_what_was_measured(page: Chrome, service: Service, twin: int) -> None:
    open_job(page, service, twin)
    text = main_text(page)
    for words in (
        "64 × 64 pixels, 24 frames in 3 rounds, primary and shadow rays timed",
        "0.653 Mray/s\n0.620–0.689 with 95 % confidence",
        "7,756 a frame\n4,096 primary and 3,660 shadow cast, counted; both timed",
        "0 of 4,096 primary rays wrong",
        "8.00 nodes\n9.50 triangles tested, 626 B fetched",
        "Against Embree\nnot measured\nnot asked for",
        "Shader hash\n" + "ab" * 32,
        "0.75, the highest of all rounds",
        "vertex normals",
    ):
        assert words in text
    assert "frames_by_round" not in text
    page.find_element(By.CSS_SELECTOR, "details.fields summary").click()
    assert "frames_by_round\n8, 8, 8" in main_text(page)
    assert "frames_cpu_ms" not in main_text(page)


def test_every_frame_is_drawn_with_median_interval_and_rounds(page: Chrome, service: Service, twin: int) -> None:
    open_job(page, service, twin)
    wait_for_chart(page)
    assert points(page) == {"95 % interval": 0, "median": 0, "wall": FRAMES, "CPU": FRAMES}
    assert len(page.find_elements(By.CSS_SELECTOR, "#chart .shapelayer path")) == ROUNDS - 1
    assert page.find_elements(By.CSS_SELECTOR, "#chart canvas") == []
    chart, after = page.find_element(By.ID, "chart").rect, page.find_element(By.ID, "frames-rounds").rect
    assert chart["y"] + page.find_element(By.CSS_SELECTOR, "#chart svg").rect["height"] <= after["y"]


def test_a_phones_counters_are_drawn_along_its_frames(page: Chrome, service: Service, phone: int) -> None:
    open_job(page, service, phone)
    wait_for_chart(page)
    found = points(page)
    assert (found["wall"], found["GPU"]) == (FRAMES, FRAMES - ROUNDS)
    assert (found["GPU temperature"], found["GPU clock"], found["GPU busy"]) == (FRAMES, FRAMES, FRAMES - ROUNDS)
    assert "CPU" not in found
    assert "3: throttled" in str(page.find_element(By.ID, "chart").get_attribute("textContent"))
    text = main_text(page)
    assert "The phone throttled around round 3" in text
    assert "Not read from this phone: skin_temp" in text
    page.find_element(By.CSS_SELECTOR, "details.frames summary").click()
    rows = page.find_elements(By.CSS_SELECTOR, "details.frames tbody tr")
    assert len(rows) == FRAMES
    assert rows[0].text == "1 1 10 not told not told 41 585 97"


def test_raw_frames_are_one_click_away(page: Chrome, service: Service, phone: int) -> None:
    open_job(page, service, phone)
    address = page.find_element(By.LINK_TEXT, "CSV").get_attribute("href")
    answer = service.client.get(str(address))
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/csv; charset=utf-8")
    lines = list(csv.DictReader(io.StringIO(answer.text)))
    view = service.get(f"jobs/{phone}/frames")
    assert len(lines) == len(view["frames"]) == FRAMES
    assert [float(line["wall_ms"]) for line in lines] == [frame["wall_ms"] for frame in view["frames"]]
    assert view["frame_ms"] == service.get(f"jobs/{phone}")["result"]["frame_ms"]


def test_frames_are_refused_in_one_sentence(service: Service) -> None:
    job = service.post("jobs", scene="forest", frames=1)["id"]
    for path, status, words in (
        (f"jobs/{job}/frames", 409, f"Job {job} is queued and has no result"),
        ("jobs/999/frames", 404, "There is no job 999."),
        (f"jobs/{job}/frames?format=xml", 422, "choose one of json, csv"),
        ("jobs/999/trace", 404, "There is no job 999."),
        ("studies/999/trace", 404, "There is no study 999."),
    ):
        answer = service.client.get(f"/api/v1/{path}")
        assert (answer.status_code, words in answer.json()["detail"]) == (status, True)
    service.client.post(f"/api/v1/jobs/{job}/cancel")


def test_a_result_without_frames_says_so(page: Chrome, service: Service) -> None:
    with service.database.writing() as session:
        [part] = add_jobs(session, [Order(request_of())])[:1]
        part.job.state = "done"
        kept = {key: value for key, value in document_of(phone=False).items() if not key.startswith("frames_")}
        add_result(session, part.job, kept)
        job = part.job.id
    open_job(page, service, job)
    assert "stored without its raw frames" in main_text(page)
    assert service.get(f"jobs/{job}/frames")["frames"] == []


def test_a_real_jobs_and_studys_life_is_a_trace(service: Service) -> None:
    study = service.post("studies", name="lives", scenes="forest", frames=2, rounds=2, size="32")
    service.work()
    job = service.get(f"studies/{study['id']}")["jobs"][0]["id"]
    answer = service.client.get(f"/api/v1/jobs/{job}/trace")
    assert answer.headers["content-disposition"] == f'attachment; filename="rayfarm-job-{job}-trace.json"'
    trace = answer.json()
    assert_rules(trace)
    assert [event["name"] for event in spans(trace, "slices")] == ["round 1", "round 2"]
    assert [event["name"] for event in spans(trace, "running")] == ["round 1", "round 2"]
    whole = service.get(f"studies/{study['id']}/trace")
    assert_rules(whole)
    assert spans(whole, f"Job {job}")[0]["args"]["state"] == "done"


def test_a_profile_is_imported_by_the_form(page: Chrome, service: Service, twin: int) -> None:
    open_job(page, service, twin)
    assert "No profiler's file has been imported" in main_text(page)
    choose(page, FIXTURES / "snapdragon_realtime.csv")
    page.find_element(By.CSS_SELECTOR, "#import button").send_keys(Keys.ENTER)
    until(page, lambda: "snapdragon_realtime.csv" in main_text(page))
    text = main_text(page)
    assert "SP memory read\n170 MB/s" in text
    assert "Snapdragon Profiler, realtime; 18 rows" in text
    assert "% Time ALUs Working" in page.find_element(By.CSS_SELECTOR, ".metrics").text
    original = page.find_element(By.LINK_TEXT, "The original file").get_attribute("href")
    answer = service.client.get(str(original))
    assert answer.content == (FIXTURES / "snapdragon_realtime.csv").read_bytes()
    assert answer.headers["content-disposition"].startswith("attachment")
    assert answer.headers["x-content-type-options"] == "nosniff"
    page.get(f"{service.client.base_url}/jobs/{twin}#profiles")


def test_any_csv_is_imported_by_the_forms_columns(page: Chrome, service: Service, phone: int) -> None:
    open_job(page, service, phone)
    choose(page, FIXTURES / "streamline.csv")
    page.find_element(By.CSS_SELECTOR, "#import details summary").click()
    page.find_element(By.NAME, "@time").send_keys("Time")
    page.find_element(By.NAME, "pairs").send_keys("SP Memory Read (Bytes)=Ext. read bytes")
    page.find_element(By.CSS_SELECTOR, "#import button").click()
    until(page, lambda: "streamline.csv" in main_text(page))
    assert "Columns: @time from Time, SP Memory Read (Bytes) from Ext. read bytes." in main_text(page)
    assert service.get(f"jobs/{phone}")["profile"]["sp_memory_read"] == 650000


def test_a_refused_file_is_answered_with_one_sentence(page: Chrome, service: Service, phone: int) -> None:
    open_job(page, service, phone)
    before = service.get(f"jobs/{phone}/profiles")
    choose(page, FIXTURES / "README.md")
    page.find_element(By.CSS_SELECTOR, "#import button").click()
    problem = page.find_element(By.ID, "import-problem")
    until(page, problem.is_displayed)
    assert problem.text.startswith("No known format begins with")
    assert page.find_element(By.CSS_SELECTOR, "#import button").is_enabled()
    assert service.get(f"jobs/{phone}/profiles") == before
    # The browser logs the refused request itself.
    assert [e["message"] for e in log(page, "browser") if "422" not in e["message"]] == []


def test_a_file_that_is_too_large_is_not_sent(page: Chrome, service: Service, phone: int, tmp_path: Path) -> None:
    open_job(page, service, phone)
    (tmp_path / "large.csv").write_bytes(bytes(1_000_001))
    choose(page, tmp_path / "large.csv")
    page.find_element(By.CSS_SELECTOR, "#import button").click()
    problem = page.find_element(By.ID, "import-problem")
    until(page, problem.is_displayed)
    assert problem.text == "The file has more than 1 MB: split it, or raise RAYFARM_PROFILE_MB."


def test_hostile_metrics_and_files_stay_text(page: Chrome, service: Service) -> None:
    job = add_measured(service.database, phone=False, scene=HOSTILE)
    rows = io.StringIO()
    writer = csv.writer(rows)
    writer.writerow(["Process", "Category", "Metric", "Timestamp", "TimestampRaw", "Value"])
    writer.writerow([HOSTILE, "c", f"=1+1 {HOSTILE}", 1, 1, 60])
    content = rows.getvalue().encode()
    params = {"name": f"{HOSTILE.replace('/', '')}.csv"}
    assert service.client.post(f"/api/v1/jobs/{job}/profiles", content=content, params=params).status_code == 201
    open_job(page, service, job)
    wait_for_chart(page)
    assert f"=1+1 {HOSTILE} ({HOSTILE})" in main_text(page)
    assert page.find_elements(By.CSS_SELECTOR, "main img, main b, main script") == []
    listed = service.client.get(f"/api/v1/jobs/{job}/profiles?format=csv")
    [line] = csv.DictReader(io.StringIO(listed.text))
    assert line["name"] == f"'=1+1 {HOSTILE}"
    assert (line["mean"], line["instance"]) == ("60.0", "")


def test_the_list_of_no_metrics_has_a_head(service: Service) -> None:
    job = add_measured(service.database, phone=False)
    answer = service.client.get(f"/api/v1/jobs/{job}/profiles?format=csv")
    assert answer.text.splitlines() == [
        "profile,format,file_name,name,instance,source,unit,count,mean,median,min,max,first_time,last_time"
    ]


def test_a_cancelled_job_is_submitted_again(page: Chrome, service: Service) -> None:
    asked = {
        "scene": "forest",
        "traversal": "kd-backtrack",
        "frames": 3,
        "rounds": 2,
        "size": "48x32",
        "sah": "2.0,1.5",
    }
    camera = {"eye": [0.0, 1.0, 5.0], "target": [0.0, 1.0, 0.0], "fov": 40.0}
    job = service.post("jobs", **asked, camera=camera, specialise=False, priority=7)["id"]
    service.client.post(f"/api/v1/jobs/{job}/cancel")
    open_job(page, service, job)
    assert "submit it again" in main_text(page)
    page.find_element(By.CSS_SELECTOR, "[data-again]").click()
    until(page, lambda: not page.current_url.endswith(f"/jobs/{job}"))
    again = service.get(f"jobs/{page.current_url.rpartition('/')[2]}")
    first = service.get(f"jobs/{job}")
    assert again["id"] != job
    assert {key: again[key] for key in ("request", "device", "priority")} == {
        key: first[key] for key in ("request", "device", "priority")
    }
    assert again["state"] == "queued"
    service.client.post(f"/api/v1/jobs/{again['id']}/cancel")


def test_a_failed_job_says_what_to_do(page: Chrome, service: Service) -> None:
    job = service.post("jobs", scene="forest", frames=1)["id"]
    with service.database.writing() as session:
        change_state(session, session.get_one(Job, job), "failed", f"The shader broke: {HOSTILE}")
    open_job(page, service, job)
    text = main_text(page)
    assert f"The shader broke: {HOSTILE}" in text
    assert "mend what the reason above says, then submit it again" in text


def test_an_idle_job_says_what_it_waits_for(page: Chrome, service: Service) -> None:
    first = service.post("jobs", scene="forest", frames=1)["id"]
    open_job(page, service, first)
    assert "It waits for a worker, and none is running: start one with rayfarm worker." in main_text(page)
    with service.database.writing() as session:
        session.add(Device(id="P9", kind="phone", presence="offline", advice="Plug it in.", facts={}))
    away = service.post("jobs", scene="forest", frames=1, device="P9")["id"]
    open_job(page, service, away)
    assert "It waits for P9, which is offline. Plug it in." in main_text(page)
    with service.working(_never):
        until(page, lambda: service.get(f"jobs/{first}")["state"] == "running")
        second = service.post("jobs", scene="forest", frames=1)["id"]
        open_job(page, service, second)
        assert f"Now running there: job {first}." in main_text(page)
        for job in (second, first, away):
            service.client.post(f"/api/v1/jobs/{job}/cancel")
        until(page, lambda: text_of(page, "state") == "cancelled")
        until(page, lambda: page.find_elements(By.ID, "wait") == [])


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 400])
def test_the_page_fits_and_everything_has_a_name(
    page: Chrome, service: Service, phone: int, width: int, scheme: str
) -> None:
    with screen(page, width, scheme):
        open_job(page, service, phone)
        wait_for_chart(page)
        for summary in page.find_elements(By.CSS_SELECTOR, "details:not([open]) > summary"):
            page.execute_script("arguments[0].click()", summary)
        assert fits(page)
        for control in page.find_elements(By.CSS_SELECTOR, f"main :is({NAMELESS})"):
            assert control.accessible_name, control.get_attribute("outerHTML")
        for region in page.find_elements(By.CSS_SELECTOR, "main table"):
            assert region.find_element(By.TAG_NAME, "caption").text
        assert page.find_elements(By.CSS_SELECTOR, "main [style]:not(#chart):not(#chart *)") == []
        levels = [int(head.tag_name[1]) for head in page.find_elements(By.CSS_SELECTOR, "h1, h2, h3")]
        assert levels[0] == 1
        assert all(below - above <= 1 for above, below in pairwise(levels))
        colour = "return getComputedStyle(document.querySelector(arguments[0]))[arguments[1]]"
        ink = page.execute_script(colour, "body", "color")
        assert page.execute_script(colour, "#chart .ytick text", "fill") == ink


def test_the_form_is_reached_and_used_by_keyboard(page: Chrome, service: Service, twin: int) -> None:
    open_job(page, service, twin)
    page.find_element(By.CSS_SELECTOR, "#import select").send_keys(Keys.TAB)
    assert page.switch_to.active_element.text == "Import"
    page.switch_to.active_element.send_keys(Keys.TAB)
    page.switch_to.active_element.send_keys(Keys.ENTER)
    assert page.find_element(By.NAME, "@metric").is_displayed()


def choose(page: Chrome, file: Path) -> None:
    page.find_element(By.CSS_SELECTOR, "#import input[type=file]").send_keys(str(file))


async def _never(held: Any, say: Any) -> dict[str, Any]:
    """A slice that runs until it is cancelled."""
    await say("running")
    await asyncio.sleep(60)
    return {}
