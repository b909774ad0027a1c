"""Comparing two sets of results: files, jobs, studies and selections, the gate's exit code, and the study `aa`."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from service_fakes import Service, document, running_service, wait_for

from renderer.request import Request
from renderer.variant import Variant
from server.cli import app as cli

ROUNDS = 10
TIMES = {"bvh-stack": 10.0, "kd-backtrack": 11.5, "bvh-parent-link": 10.0}
"""Frame times in ms; kd-backtrack is the planted slowdown."""


def measured(request: Request, *_: Any) -> dict[str, Any]:
    """A result with ten rounds of two frames around its traversal's time."""
    time = TIMES[request.variant.traversal]
    frames = [time * (1 + 0.002 * i) for i in range(ROUNDS) for _ in range(2)]
    return document(request, 1.0) | {"frames_ms": frames, "frames_by_round": [2] * ROUNDS}


def result(traversal: str = "bvh-stack", scene: str = "forest", **changes: Any) -> dict[str, Any]:
    return measured(Request(scene, Variant(traversal=traversal))) | changes


def write(path: Path, *results: dict[str, Any]) -> str:
    path.write_text("".join(json.dumps(item) + "\n" for item in results), encoding="utf-8")
    return str(path)


def rayfarm(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = cli.run(words)
    out, err = capsys.readouterr()
    return code, out, err


def gate(capsys: pytest.CaptureFixture[str], baseline: str, against: str, *words: str) -> tuple[int, str, str]:
    return rayfarm(capsys, "compare", "--baseline", baseline, "--against", against, "--gate", *words)


def slower(traversal: str, factor: float, **changes: Any) -> dict[str, Any]:
    same = result(traversal)
    return same | {"frames_ms": [time * factor for time in same["frames_ms"]]} | changes


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    with running_service(tmp_path) as running:
        yield running


@pytest.fixture
def worked(service: Service) -> Iterator[Service]:
    """A service whose queue is worked on beside the test."""
    with service.working(combine=measured):
        yield service


@pytest.mark.parametrize(
    ("factor", "words", "code"),
    [(1.0, (), 0), (1.1, (), 1), (0.9, (), 0), (1.1, ("--threshold", "20"), 0), (1.1, ("--threshold", "5"), 1)],
)
def test_the_gate_stops_a_slowdown_that_passes_its_threshold(
    factor: float, words: tuple[str, ...], code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = write(tmp_path / "a", result()), write(tmp_path / "b", slower("bvh-stack", factor))
    got, out, err = gate(capsys, ours, theirs, *words)
    assert (got, err) == (code, "")
    assert f"Gate {'stopped' if code else 'passed'}: {code} of 1 slower" in out
    assert f"{factor:.3f}" in out


def test_without_gate_a_slowdown_is_told_and_ends_in_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--baseline", write(tmp_path / "a", result()), "--against", write(tmp_path / "b", slower("bvh-stack", 2)))
    code, out, _ = rayfarm(capsys, "compare", *words)
    assert code == 0
    assert "slower" in out


def test_pairs_share_all_that_is_not_compared_and_the_rest_is_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = write(tmp_path / "a", result(), result("kd-backtrack"), result(scene="cornell-box"))
    theirs = write(tmp_path / "b", slower("kd-backtrack", 1.2), result(), result(size=[8, 8]))
    code, out, _ = gate(capsys, ours, theirs, "--json")
    view = json.loads(out)
    assert code == 1
    assert {(pair["place"]["traversal"], pair["verdict"]) for pair in view["pairs"]} == {
        ("bvh-stack", "no difference found"),
        ("kd-backtrack", "slower"),
    }
    assert [place["scene"] for place in view["only_baseline"]] == ["cornell-box"]
    assert [place["size"] for place in view["only_against"]] == ["8x8"]


def test_environments_that_differ_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    there = result()["device"] | {"driver": "Mesa [2]"}
    versions = {"rayfarm": "0.2.0", "shader_sha": "cd" * 8, "plan": 1}
    ours, theirs = write(tmp_path / "a", result()), write(tmp_path / "b", result(device=there, versions=versions))
    _, out, _ = gate(capsys, ours, theirs)
    for words in ("driver: Mesa → Mesa [2]", "rayfarm: 0.1.0 → 0.2.0", "shader_sha: abab", "environments differ"):
        assert words in out


def test_the_latest_of_several_is_compared_and_the_others_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours = write(tmp_path / "a", slower("bvh-stack", 9), result())
    code, out, _ = gate(capsys, ours, write(tmp_path / "b", result()))
    assert code == 0
    assert "1 older results" in out


def test_rounds_that_are_not_interleaved_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    times = [f"2026-01-01T00:{minute:02}:00+00:00" for minute in range(20)]
    ours = write(tmp_path / "a", result(rounds_started_at=times[:10]))
    later = write(tmp_path / "b", result(rounds_started_at=times[10:]))
    beside = write(tmp_path / "c", result(rounds_started_at=times[5:15]))
    assert "one after the other" in gate(capsys, ours, later)[1]
    assert "one after the other" not in gate(capsys, ours, beside)[1]


def test_too_few_rounds_pass_and_say_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flat = {name: value for name, value in slower("bvh-stack", 3).items() if name != "frames_by_round"}
    code, out, _ = gate(capsys, write(tmp_path / "a", result()), write(tmp_path / "b", flat))
    assert code == 0
    assert "at least 4 rounds" in out
    assert "1 could not be judged" in out


BAD = {
    "no such file": ("nowhere.jsonl", "Cannot read"),
    "not a number": ("job:x", "write it as job:12"),
    "unknown filter": ("study:1,colour=red", "colour=red"),
    "nothing": ("", "is empty"),
    "not results": ("wrong", "no JSON Lines"),
    "other JSON": ("other", "holds no results"),
    "filtered away": ("good,layout=split", "There is no result"),
    "no partner": ("good,scene=forest", "has a partner"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_sides_are_one_sentence_and_2(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "good", result())
    (tmp_path / "wrong").write_text("scene,speed\n", encoding="utf-8")
    (tmp_path / "other").write_text("[1]\n", encoding="utf-8")
    text, sentence = BAD[name]
    code, out, err = gate(capsys, text or ",", write(tmp_path / "small", result(size=[8, 8])))
    assert (code, out) == (2, "")
    assert sentence in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("words", [("--gate",), ("--baseline", "job:1"), ("--against", "job:1")])
def test_one_side_alone_is_refused(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = rayfarm(capsys, "compare", *words)
    assert code == 2
    assert "takes both --baseline and --against" in err


def test_stored_results_are_compared_alike_by_command_and_api(
    worked: Service, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    axes = {"traversal": "bvh-stack,kd-backtrack", "layout": "normal,compact"}
    worked.post("studies", name="x", scenes="forest", axes=axes, frames=20, rounds=10)
    wait_for(lambda: worked.get("studies/1")["state"] == "done", 60)
    there = ("--server", str(worked.client.base_url))
    for ours, theirs, pairs, stopped in (
        ("job:1", "job:1", 1, 0),
        ("study:1", "study:1", 4, 0),
        ("study:1,traversal=bvh-stack", "study:1,traversal=kd-backtrack", 2, 1),
        ("traversal=bvh-stack,layout=normal", "traversal=kd-backtrack,layout=compact", 1, 1),
    ):
        code, out, _ = gate(capsys, ours, theirs, "--json", *there)
        answer = worked.client.get("/api/v1/difference", params={"baseline": ours, "against": theirs}).json()
        assert json.loads(out) == answer
        assert (code, answer["passed"], len(answer["pairs"])) == (stopped, not stopped, pairs)
    stored = gate(capsys, write(tmp_path / "file", result()), "study:1,layout=normal", *there)
    assert stored[0] == 0
    assert "Only in against" in stored[1]


@pytest.mark.parametrize(
    ("params", "status", "words"),
    [
        ({"baseline": "job:7", "against": "job:7"}, 404, "There is no job 7"),
        ({"baseline": "job:1"}, 422, "against is missing"),
        ({"baseline": "/etc/passwd", "against": "job:1"}, 422, "is not stored here"),
        ({"baseline": "scene=<b>", "against": "scene=x"}, 422, "There is no result"),
        ({"baseline": "scene=x", "against": "scene=x", "clock": "sun"}, 422, "Unknown clock"),
        ({"baseline": "scene=x", "against": "scene=x", "gate": "-1"}, 422, "gate"),
    ],
)
def test_the_api_refuses_in_a_sentence(service: Service, params: dict[str, str], status: int, words: str) -> None:
    answer = service.client.get("/api/v1/difference", params=params)
    assert answer.status_code == status
    assert words in answer.json()["detail"]


def test_the_study_aa_counts_false_alarms_on_a_service(worked: Service, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("study", "aa", "--repeats", "7", "--rounds", "4", "--frames", "8", "--json")
    code, out, _ = rayfarm(capsys, *words, "--server", str(worked.client.base_url))
    [device] = json.loads(out)["devices"]
    assert code == 0
    assert device["setup"]["traversal"] == "bvh-stack"
    assert (device["differing"]["found"], device["differing"]["tries"]) == (0, 3)
    assert device["differing"]["low"] == 0
    assert device["stopped"]["high"] == pytest.approx(0.561, abs=1e-3)
    assert 0 < device["visible"] < 0.05


def test_the_study_aa_measures_here(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("study", "aa", "--repeats", "2", "--rounds", "1", "--frames", "1", "--size", "16")
    code, out, err = rayfarm(capsys, *words)
    if "EGL" in err:
        pytest.skip(f"no EGL here: {err}")
    assert code == 0
    assert "1 pairs of 1 rounds" in out
    assert "it takes at least 4 rounds" in out
