"""Bad input: every refusal is problem+json with one clear sentence, and the service goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import httpx
import pytest
from service_fakes import Service, running_service


@pytest.fixture(scope="module")
def service(
    tmp_path_factory: pytest.TempPathFactory,
    database_kind: str,
    fresh_database: Callable[[str], AbstractContextManager[str]],
) -> Iterator[Service]:
    with (
        fresh_database(database_kind) as url,
        running_service(tmp_path_factory.mktemp("service"), url) as running,
    ):
        yield running


def check(answer: httpx.Response, status: int, *words: str) -> None:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert body["status"] == status
    assert body["title"]
    for word in words:
        assert word in body["detail"]
    assert body["detail"].endswith(".")
    assert "\n" not in body["detail"]
    assert "Traceback" not in body["detail"]


BAD_JOBS: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "unknown scene": ({"scene": "atlantis"}, ("atlantis", "cornell-box", "forest")),
    "a path of the server": ({"scene": "/etc/passwd"}, ("/etc/passwd", "cornell-box")),
    "a relative path": ({"scene": "../scenes/data/cornell_box.obj"}, ("choose one of",)),
    "too many triangles": ({"scene": "forest:99999999999"}, ("forest",)),
    "unknown traversal": ({"traversal": "bvh-teleport"}, ("bvh-teleport", "kd-backtrack", "bvh-stack")),
    "unknown method": ({"method": "rasterise"}, ("rasterise", "fragment, compute, hybrid")),
    "unknown layout": ({"layout": "zip"}, ("zip", "compact")),
    "unknown check": ({"check": "twice"}, ("twice", "referee")),
    "refused combination": ({"traversal": "kd-push-down", "builder": "median"}, ("KD-tree", "sah")),
    "hybrid without shadows": ({"method": "hybrid", "rays": "primary"}, ("hybrid", "primary")),
    "size 0": ({"size": 0}, ("0", "from 1 to")),
    "size 100000": ({"size": 100000}, ("100000", "from 1 to")),
    "size of words": ({"size": "big"}, ("big", "640x480")),
    "size of three": ({"size": [1, 2, 3]}, ("size",)),
    "frames 0": ({"frames": 0}, ("frames",)),
    "more rounds than frames": ({"frames": 2, "rounds": 3}, ("rounds",)),
    "frames of words": ({"frames": "many"}, ("frames", "integer")),
    "costs of zero": ({"sah": {"traversal": 0, "intersection": 1}}, ("SAH",)),
    "costs that are infinite": ({"sah": "inf,1"}, ("SAH",)),
    "costs of one": ({"sah": "3"}, ("3.0,1.5",)),
    "a field that does not exist": ({"traversl": "bvh-stack"}, ("traversl",)),
    "camera without a target": ({"camera": {"eye": [0, 0, 0], "fov": 60}}, ("camera.target", "missing")),
    "camera with NaN": ({"camera": {"eye": [0, 0, "nan"], "target": [1, 0, 0], "fov": 60}}, ("camera",)),
    "camera that looks nowhere": ({"camera": {"eye": [1, 0, 0], "target": [1, 0, 0], "fov": 60}}, ("camera",)),
}


@pytest.mark.parametrize("name", BAD_JOBS)
def test_a_bad_job_is_refused(service: Service, name: str) -> None:
    body, words = BAD_JOBS[name]
    check(service.client.post("/api/v1/jobs", json={"scene": "cornell-box"} | body), 422, *words)


BAD_STUDIES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "unknown study": ({"name": "nothing"}, ("nothing", "demo")),
    "no scenes": ({"name": "x", "scenes": []}, ("scene",)),
    "unknown scene": ({"name": "x", "scenes": ["cornell-box", "atlantis"]}, ("atlantis",)),
    "unknown axis": ({"name": "x", "scenes": "forest", "axes": {"colour": "red"}}, ("colour", "traversal")),
    "unknown value": ({"name": "x", "scenes": "forest", "axes": {"traversal": "paper,red"}}, ("red", "bvh-stack")),
    "nothing left": (
        {"name": "x", "scenes": "forest", "axes": {"traversal": "kd-backtrack", "builder": "median"}},
        ("Every combination", "KD-tree"),
    ),
    "too much": ({"name": "x", "scenes": "forest", "axes": {"box": "all"}, "frames": 10000, "rounds": 10000}, ("200",)),
    "size 0": ({"name": "demo", "size": 0}, ("width",)),
}


@pytest.mark.parametrize("name", BAD_STUDIES)
def test_a_bad_study_is_refused(service: Service, name: str) -> None:
    body, words = BAD_STUDIES[name]
    if name == "too much":
        body = body | {"scenes": ["forest", "cornell-box"]}
        words = ("20000", "slices")
    check(service.client.post("/api/v1/studies", json=body), 422, *words)


@pytest.mark.parametrize(
    ("content", "status", "word"),
    [
        (b'{"scene": ', 400, "not valid JSON"),
        (b"", 422, "body"),
        (b"[]", 422, "object"),
        (b'"cornell-box"', 422, "object"),
        (b"\xff\xfe", 400, "JSON"),
    ],
)
def test_a_bad_body_is_refused(service: Service, content: bytes, status: int, word: str) -> None:
    headers = {"content-type": "application/json"}
    check(service.client.post("/api/v1/jobs", content=content, headers=headers), status, word)


@pytest.mark.parametrize(
    ("path", "status", "word"),
    [
        ("jobs/1", 404, "no job 1"),
        ("jobs/0", 404, "no job 0"),
        ("jobs/x", 404, "no job x"),
        ("jobs/3000000000", 404, "no job 3000000000"),
        ("jobs/99999999999999999999", 404, "no job"),
        ("studies/7", 404, "no study 7"),
        ("studies/3000000000", 404, "no study"),
        ("nothing", 404, "/api/v1/nothing"),
        ("jobs?state=asleep", 422, "state"),
        ("jobs?limit=0", 422, "limit"),
        ("jobs?before=99999999999999999999", 422, "before"),
        ("jobs?study=-99999999999999999999", 422, "study"),
        ("compare?metric=beauty", 422, "mrays_per_s"),
        ("compare?rows=beauty", 422, "traversal"),
        ("compare?cols=,", 422, "columns"),
        ("compare?traversal=beauty", 422, "bvh-stack"),
        ("compare?format=xml", 422, "csv"),
        ("compare?study=x", 422, "number"),
        ("compare?colour=red", 422, "colour"),
    ],
)
def test_a_bad_question_is_refused(service: Service, path: str, status: int, word: str) -> None:
    check(service.client.get(f"/api/v1/{path}"), status, word)


def test_a_wrong_method_names_the_right_one(service: Service) -> None:
    answer = service.client.put("/api/v1/jobs", json={})
    check(answer, 405, "PUT")


def test_a_foreign_host_name_is_refused(service: Service) -> None:
    check(service.client.get("/api/v1/jobs", headers={"host": "evil.example"}), 400, "evil.example")
    port = service.client.base_url.port
    assert service.client.get("/livez", headers={"host": f"[::1]:{port}"}).status_code == 200


@pytest.mark.parametrize("kind", ["application/json", "text/plain", "application/x-www-form-urlencoded"])
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_a_foreign_page_may_not_submit(service: Service, origin: str, kind: str) -> None:
    before = service.get("jobs")
    body, headers = b'{"scene": "cornell-box"}', {"origin": origin, "content-type": kind}
    for path in ("jobs", "jobs/1/cancel", "studies", "devices/pair"):
        check(service.client.post(f"/api/v1/{path}", content=body, headers=headers), 403, "origin")
    assert service.get("jobs") == before


@pytest.mark.parametrize("kind", [None, "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"])
def test_what_a_form_can_send_is_no_submission(service: Service, kind: str | None) -> None:
    """Pages send these to any site without asking it first."""
    headers = {} if kind is None else {"content-type": kind}
    answer = service.client.post("/api/v1/jobs", content=b'{"scene": "cornell-box"}', headers=headers)
    check(answer, 422, "application/json")


def test_nothing_was_queued_by_any_of_it(service: Service) -> None:
    assert service.get("jobs")["jobs"] == []
    service.post("jobs", scene="cornell-box", size=16, frames=1)
    service.work()
    assert service.get("jobs?state=done")["jobs"]
