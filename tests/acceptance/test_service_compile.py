"""Jobs that compile: over HTTP, by a real worker, beside a phone's figures, on their pages in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browsing import running_browser, until, watched
from selenium.webdriver.common.by import By
from service_fakes import Service, document, running_service, wait_for

from renderer.bench import combine
from renderer.phone_compile.gpus import USUAL
from renderer.phone_compile.toolchain import MissingError, tool_chain
from renderer.request import Request
from server.compiled.kept import keep_listing
from server.settings import Settings
from server.slices import SliceRunner
from server.store.blobs import Blobs
from server.store.records import Order, add_jobs, add_result

HOSTILE = "</script><b>mov.u32u32 r0.x</b>"
GPUS = ("adreno-540", "mali-g57")
ASTRAY = """
const align = (cell) => getComputedStyle(cell).textAlign;
return [...document.querySelectorAll("table.compiled")].flatMap((table) => {
  const cells = table.tBodies[0].rows[0]?.cells ?? [];
  return [...table.tHead.rows[0].cells].filter((head, i) => cells[i] && align(head) !== align(cells[i]));
}).map((head) => head.textContent);
"""
"""The heads of tables of estimates that are not aligned as what stands below them."""


def row(gpu: str, alu: float | None) -> dict[str, Any]:
    """An estimate; None for one that failed."""
    known = {
        "instructions": 1125, "alu_per_fragment": alu, "memory_per_fragment": 85.6, "alu_per_ray": 1.0,
        "memory_per_ray": 2.0, "bytes_per_ray": 3.0, "registers": 24, "half_registers": 11, "waves": 2, "spills": 0,
        "loops": 8, "kinds": {"alu": 500}, "per_fragment": {"alu": 2000.5}, "residual": 0.0, "freedom": 0,
        "roofline": {"bound": "ALU", "balance": 34.5, "source": "Rates: assumed.", "alu_cycles": 1.0,
                     "memory_cycles": 1.0, "bytes_cycles": None},
        "disassembly": ["nop", HOSTILE, "end"], "weights": [[0, 1, 1.0], [1, 3, 7.25]],
    }  # fmt: skip
    lacking: dict[str, Any] = dict.fromkeys(known) | {"kinds": {}, "per_fragment": {}}
    return {
        "gpu": gpu,
        "label": "Mesa ir3 estimate",
        "mesa": "25.0.7",
        "stage": "fragment",
        "limit": None,
        "limits": {"FRAGMENT_SHADER_STORAGE_BLOCKS": {"needs": 2, "mesa": 12, "vendor": 4}},
        "programs": {},
        "text": "Mesa ir3 estimate, made up.",
        **(
            lacking | {"reason": f"Mesa's driver for {gpu} crashed on this text (signal 11)."} if alu is None else known
        ),
        **({"reason": None} if alu is not None else {}),
    }


def measurement(request: Request) -> dict[str, Any]:
    """What the child of a job that compiles answers."""
    whole = document(request, 1.0)
    shared = (
        "triangles",
        "sah",
        "structure_bytes",
        "primitive_bytes",
        "build_ms",
        "specialised",
        "versions",
        "started_at",
    )
    rows = [row("adreno-540", 2991.2), row("mali-g57", None)]
    return {**{name: whole[name] for name in shared}, "depth": 4, "round": 0, "gpus": rows, "glsl": "void main() {}\n"}


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Job 1 was compiled; job 2 measured the same on an Adreno 540 and has a profile."""
    folder = tmp_path_factory.mktemp("service")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAYFARM_BLOBS", str(folder / "blobs"))
        with running_service(folder) as running:
            compiled = Request("forest", frames=1, rounds=1, gpus=GPUS)
            taken = keep_listing(measurement(compiled), Blobs(folder / "blobs"))
            phone = document(Request("forest"), 1.0, "R58N") | {"profile": {"alu_per_fragment": 3589.44}}
            phone["device"] |= {"kind": "phone", "name": "SM-G950F", "renderer": "Adreno (TM) 540"}
            _done(running, compiled, combine(compiled, [taken]))
            _done(running, Request("forest"), phone)
            yield running


def _done(service: Service, request: Request, result: dict[str, Any]) -> None:
    with service.database.writing() as session:
        job = add_jobs(session, [Order(request)])[0].job
        job.state = "done"
        for part in job.slices:
            part.state = "done"
        add_result(session, job, result)


def test_a_result_is_a_column_of_the_comparison(service: Service) -> None:
    metric = "model_compiled_adreno_540_alu_per_fragment"
    view = service.get(f"compare?metric={metric}&device=mesa-compilers")
    (cell,) = view["table"][0]["cells"]
    assert cell["figures"][metric]["value"] == 2991.2
    assert view["notes"] == [
        "ALU per fragment, adreno-540 (Mesa ir3 estimate): Mesa ir3 estimate, made up.",
    ]
    # Speeds are those that were measured, though the job that compiled may be the later one.
    assert service.get("compare")["table"][0]["cells"][0]["job"] == 2


def test_a_listing_lies_beside_the_glsl(service: Service) -> None:
    listing = service.get("jobs/1/listing?gpu=adreno-540")
    assert listing["disassembly"] == ["nop", HOSTILE, "end"]
    assert listing["glsl"] == "void main() {}\n"
    for path, sentence in (
        ("jobs/1/listing?gpu=adreno-9", "Job 1 has no listing for 'adreno-9'."),
        ("jobs/2/listing?gpu=adreno-540", "Job 2 was not compiled for GPUs, or has no result yet."),
    ):
        answer = service.client.get(f"/api/v1/{path}")
        assert (answer.status_code, answer.json()["detail"]) == (404, sentence)


def test_what_cannot_be_compiled_is_refused(service: Service) -> None:
    for body, part in (
        ({"gpus": ["adreno-9"]}, "Unknown GPU 'adreno-9': choose one of adreno-510"),
        ({"gpus": GPUS, "device": "R58N"}, "Compiling for GPUs takes no device: leave R58N out."),
        ({"gpus": GPUS, "frames": 5}, "leave frames and rounds out"),
    ):
        answer = service.client.post("/api/v1/jobs", json={"scene": "cornell-box", **body})
        assert answer.status_code == 422
        assert part in answer.json()["detail"]


def test_pages_show_estimates_beside_what_a_phone_measured(service: Service, tmp_path: Path) -> None:
    with running_browser(tmp_path) as browser, watched(browser, service.client.base_url):
        for path, words in (
            (
                "compile",
                ["2,991", "crashed on this text (signal 11)", "3,589 1.20 times the estimate", "Mesa ir3 estimate"],
            ),
            ("jobs/1", ["GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS 12 (the vendor's driver: 4)", "2,000.5"]),
            ("jobs/1/listing?gpu=adreno-540", ["7.25", HOSTILE, "void main() {}"]),
        ):
            browser.get(f"{service.client.base_url}/{path}")
            shown = " ".join(browser.find_element(By.TAG_NAME, "main").text.split())
            for word in words:
                assert word in shown, path
            assert not browser.find_elements(By.CSS_SELECTOR, "pre b")
            assert browser.execute_script(ASTRAY) == []
        browser.get(f"{service.client.base_url}/compile")
        browser.find_element(By.CSS_SELECTOR, "#compile button").click()
        until(browser, lambda: "/studies/" in browser.current_url)
    study = service.get("studies/1")
    assert study["slices"]["total"] == 1
    assert service.get("jobs?study=1")["jobs"][0]["variant"] == "bvh-stack fragment normal"
    assert tuple(service.get("jobs/3")["request"]["gpus"]) == USUAL


def _compile(folder: Path, **environment: str) -> Iterator[Service]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"RAYFARM_BLOBS": str(folder / "blobs"), **environment}.items():
            patch.setenv(name, value)
        with running_service(folder) as service:
            service.post("jobs", scene="cornell-box", size=32, gpus="adreno-540,mali-g72")
            service.post("jobs", scene="cornell-box", size=32, frames=1, check="none")
            runner = SliceRunner(service.database, Settings(), lambda: True)
            with service.working(runner, combine) as worker:
                wait_for(worker.is_idle, 120)
            yield service


def test_a_missing_tool_chain_is_one_sentence_and_the_farm_goes_on(tmp_path: Path) -> None:
    for service in _compile(tmp_path, RAYFARM_PHONE_COMPILER=str(tmp_path / "nothing")):
        job = service.get("jobs/1")
        assert job["state"] == "failed"
        assert job["reason"].startswith("Mesa's compilers for phone GPUs are not in ")
        assert service.get("jobs/2")["state"] == "done"
        told = service.get("compilers")
        assert told["mesa"] is None
        assert "`make phone-compiler`" in told["advice"]
        assert "make phone-compiler" in service.client.get("/compile").text


def test_a_real_worker_compiles(tmp_path: Path) -> None:
    try:
        version = tool_chain().version
    except MissingError as error:
        pytest.skip(str(error))
    for service in _compile(tmp_path):
        result = service.get("jobs/1")["result"]
        assert [(row["gpu"], row["reason"]) for row in result["compiled"]["gpus"]] == [
            ("adreno-540", None),
            ("mali-g72", None),
        ]
        assert result["device"]["driver"] == f"Mesa {version}"
        for gpu in ("adreno-540", "mali-g72"):
            listing = service.get(f"jobs/1/listing?gpu={gpu}")
            assert listing["glsl"].startswith("#version 310 es")
            assert max(times for _, _, times in listing["weights"]) > 1
            assert service.client.get(f"/jobs/1/listing?gpu={gpu}").status_code == 200
