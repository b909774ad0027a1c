"""The command line against a running service, and the whole of it with a real measurement."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from service_fakes import Service, running_service

from server.cli import app as cli
from server.store.states import OPEN


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


@pytest.fixture
def worked(service: Service) -> Iterator[Service]:
    """A service whose queue is worked on beside the test."""
    with service.working():
        yield service


def rayfarm(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = cli.run(words)
    out, err = capsys.readouterr()
    return code, out, err


def address(service: Service) -> str:
    return str(service.client.base_url)


def test_submit_shows_progress_the_table_and_the_page(worked: Service, capsys: pytest.CaptureFixture[str]) -> None:
    words = (
        "submit",
        "cornell-box",
        "--traversal",
        "paper",
        "--builder",
        "sah,median",
        "--frames",
        "2",
        "--size",
        "32",
    )
    code, out, err = rayfarm(capsys, *words, "--server", address(worked))
    assert (code, err) == (0, "")
    assert "Left out: median is a BVH builder" in out
    assert "[6/6]" in out
    assert "kd-push-down" in out
    assert "0.900 Mray/s" in out
    assert f"See it at {address(worked)}/?study=1&rows=traversal,builder" in out


def test_submit_as_json_is_nothing_but_json(worked: Service, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = rayfarm(capsys, "submit", "forest", "--frames", "1", "--json", "--server", address(worked))
    answer = json.loads(out)
    assert code == 0
    assert answer["study"]["state"] == "done"
    assert answer["comparison"]["table"][0]["cells"][0]["figures"]["mrays_per_s"]["value"] == 2.0


def test_a_failed_job_is_told_and_ends_in_1(worked: Service, capsys: pytest.CaptureFixture[str]) -> None:
    worked.bench.failing = {"bvh-stack": MemoryError("too big")}
    code, out, _ = rayfarm(capsys, "submit", "forest", "--frames", "1", "--server", address(worked))
    assert code == 1
    assert "failed: The measurement stopped unexpectedly: MemoryError: too big." in out


def test_compare_prints_table_csv_and_json(service: Service, capsys: pytest.CaptureFixture[str]) -> None:
    service.post("studies", name="x", scenes="forest", axes={"traversal": "paper"}, frames=1)
    service.work()
    there = ("--server", address(service))
    _, table, _ = rayfarm(capsys, "compare", "traversal=kd-backtrack", "--metric", "per_ray.nodes", *there)
    assert "34.2 nodes/ray" in table
    assert "bvh-parent-link" not in table
    _, csv, _ = rayfarm(capsys, "compare", "--csv", *there)
    assert csv.startswith("job,study,recorded_at,scene")
    assert len(csv.splitlines()) == 5
    _, text, _ = rayfarm(capsys, "compare", "--json", *there)
    assert len(json.loads(text)["table"]) == 4


BAD: dict[str, tuple[tuple[str, ...], str]] = {
    "unknown scene": (("submit", "atlantis"), "Unknown scene 'atlantis'"),
    "unknown traversal": (("submit", "forest", "--traversal", "red"), "Unknown traversal 'red'"),
    "size 0": (("submit", "forest", "--size", "0"), "The width is 0"),
    "no scene": (("submit",), "Name a scene"),
    "unknown option": (("submit", "forest", "--colour", "red"), "No such option"),
    "unknown study": (("study", "red"), "Unknown study 'red'"),
    "wrong size": (("study", "demo", "--size", "red"), "640x480"),
    "wrong filter": (("compare", "red"), "scene=forest"),
    "unknown metric": (("compare", "--metric", "red"), "Unknown metric 'red'"),
    "unknown verb": (("red",), "No such command"),
    "unknown download": (("scenes", "fetch", "red"), "no scene 'red'"),
    "port out of range": (("serve", "--port", "70000"), "65535"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_sentence_and_2(service: Service, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    words, sentence = BAD[name]
    there = ("--server", address(service)) if words[0] in ("submit", "compare") else ()
    code, out, err = rayfarm(capsys, *words, *there)
    assert (code, out) == (2, "")
    assert sentence in err
    assert len(err.splitlines()) == 1


def test_no_service_is_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = rayfarm(capsys, "compare", "--server", "http://127.0.0.1:1")
    assert code == 2
    assert "No RayFarm service answers at http://127.0.0.1:1" in err


def test_a_port_in_use_is_one_sentence(service: Service) -> None:
    command = [sys.executable, "-m", "server.cli.app", "serve", "--port", str(service.client.base_url.port)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "address already in use" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_scenes_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    _, table, _ = rayfarm(capsys, "scenes")
    assert "174,000" in table
    _, text, _ = rayfarm(capsys, "scenes", "--json")
    assert {"cornell-box", "forest"} <= {entry["name"] for entry in json.loads(text)}


def test_every_verb_takes_json() -> None:
    help_text = {verb: _help(verb) for verb in ("serve", "worker", "submit", "compare", "study", "scenes", "up")}
    assert [verb for verb, text in help_text.items() if "--json" not in text] == []


def test_serve_measures_for_real_and_leaves_no_children(tmp_path: Path) -> None:
    """One request, a real worker, a real measurement; then SIGTERM ends everything."""
    environment = os.environ | {"RAYFARM_DATABASE_URL": f"sqlite:///{tmp_path / 'x.sqlite'}"}
    command = [sys.executable, "-m", "server.cli.app", "serve", "--port", "0", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as server:
        try:
            assert server.stdout is not None
            base = json.loads("".join(server.stdout.readline() for _ in range(3)))["address"]
            job = _wait_for_job(base, {"scene": "cornell-box", "size": 32, "frames": 6, "rounds": 2, "vs_embree": True})
            children = _children(server.pid)
        finally:
            server.send_signal(signal.SIGTERM)
            code = server.wait(30)
    if job["state"] == "failed" and "EGL" in str(job["reason"]):
        pytest.skip(f"no EGL here: {job['reason']}")
    assert code == 0
    assert job["state"] == "done", job["reason"]
    assert job["result"]["vs_embree"]["ratio"] > 0
    assert job["result"]["error"]["false_hit"] == 0
    assert children != []
    assert [pid for pid in children if Path(f"/proc/{pid}").exists()] == []


def _help(verb: str) -> str:
    command = [sys.executable, "-m", "server.cli.app", verb, "--help"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def _wait_for_job(base: str, body: dict[str, Any]) -> dict[str, Any]:
    with httpx.Client(base_url=base, timeout=30, trust_env=False) as client:
        job: dict[str, Any] = client.post("/api/v1/jobs", json=body).raise_for_status().json()
        deadline = time.monotonic() + 180
        while job["state"] in OPEN:
            assert time.monotonic() < deadline, "the job did not end in 180 s"
            time.sleep(0.2)
            job = client.get(job["url"]).json()
        return job


def _children(pid: int) -> list[int]:
    listed = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    return [int(text) for line in listed for text in line.split()]
