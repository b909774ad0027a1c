"""A local study that is interrupted, and goes on; its journal torn, locked, and gone in the end."""

from __future__ import annotations

import random
from collections import Counter
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from test_bench import measurement

from renderer.answering import Say, silent
from renderer.child import ChildError
from renderer.request import Request
from renderer.variant import Variant
from server.cli import app as cli
from server.cli import study_here
from server.cli.journal import Journal, JournalError, Kept, open_journal

REQUESTS = [
    Request(scene, Variant(traversal), frames=4, rounds=2)
    for scene in ("cornell-box", "forest")
    for traversal in ("bvh-stack", "kd-backtrack")
]
TOTAL = 8


@pytest.fixture(autouse=True)
def _state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)


class Slices:
    """Stands for the measuring of slices: counts them, is interrupted at one of them, fails where it is told to."""

    def __init__(self, interrupt_at: int = -1, failing: str = "") -> None:
        self.ran: list[tuple[str, str, int]] = []
        self.interrupt_at, self.failing = interrupt_at, failing

    def __call__(
        self, request: Request, round_index: int, *, pictures: Path | None = None, note: Say = silent
    ) -> dict[str, Any]:
        if len(self.ran) == self.interrupt_at:
            raise KeyboardInterrupt
        self.ran.append((request.scene, request.variant.traversal, round_index))
        if request.variant.traversal == self.failing:
            raise ChildError("The stand-in fails.")
        if pictures is not None and round_index == 0:
            (pictures / "picture.png").write_text(request.scene)
        return measurement(round_index, [0.01, 0.01])


def run(monkeypatch: pytest.MonkeyPatch, slices: Slices, requests: list[Request] = REQUESTS) -> tuple[Any, str]:
    """The results, and what was said."""
    monkeypatch.setattr(study_here, "run_slice", slices)
    said = StringIO()
    with open_journal(requests) as journal:
        return study_here.measure(requests, journal, Console(file=said), journal.pictures), said.getvalue()


@pytest.mark.parametrize("seed", range(5))
def test_an_interrupted_study_measures_every_slice_once(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stops = sorted(random.Random(seed).sample(range(TOTAL), 2))
    ran: list[tuple[str, str, int]] = []
    for stop in stops:
        slices = Slices(stop - len(ran))
        with pytest.raises(KeyboardInterrupt):
            run(monkeypatch, slices)
        ran += slices.ran
        assert len(ran) == stop
    last = Slices()
    results, said = run(monkeypatch, last)
    assert Counter([*ran, *last.ran]) == Counter(
        (request.scene, request.variant.traversal, index) for request in REQUESTS for index in range(2)
    )
    assert (f"{stops[1]} of 8 slices were measured before; --fresh starts anew." in said) == (stops[1] > 0)
    assert [result["frames"] for result in results] == [4] * 4


def test_requests_that_are_alike_each_take_one(monkeypatch: pytest.MonkeyPatch) -> None:
    requests = [REQUESTS[0]] * 3
    with pytest.raises(KeyboardInterrupt):
        run(monkeypatch, Slices(4), requests)
    slices = Slices()
    results, _ = run(monkeypatch, slices, requests)
    assert [index for *_, index in slices.ran] == [1, 1]
    assert [result["frames_by_round"] for result in results] == [[2, 2]] * 3


@pytest.mark.parametrize("cut", [1, 40, -1])
def test_a_torn_line_is_measured_again(cut: int) -> None:
    with open_journal(REQUESTS) as journal:
        for index in range(2):
            journal.keep(REQUESTS[0], index, Kept(1.5, {"round": index}))
    whole = journal.path.read_bytes()
    second = whole.index(b"\n") + 1
    journal.path.write_bytes(whole[: second + cut] if cut > 0 else whole[:cut])
    with open_journal(REQUESTS) as again:
        assert len(again) == 1
        assert again.take(REQUESTS[0], 0) == Kept(1.5, {"round": 0})
        assert again.take(REQUESTS[0], 1) is None
        again.keep(REQUESTS[0], 1, Kept(2.0, {"round": 1}))
    with open_journal(REQUESTS) as last:
        assert (len(last), last.take(REQUESTS[0], 1)) == (2, Kept(2.0, {"round": 1}))


def test_one_study_runs_once_at_a_time() -> None:
    with open_journal(REQUESTS) as journal:
        with pytest.raises(JournalError, match=r"running here already"), open_journal(REQUESTS):
            pass
        with open_journal(REQUESTS[:1]) as other:
            assert other.path != journal.path
        journal.remove()
        with open_journal(REQUESTS) as next_one:  # A file of its own, though the first one is still open.
            next_one.keep(REQUESTS[0], 0, Kept(1.0, {}))
    with open_journal(REQUESTS) as again:
        assert len(again) == 1


def test_another_plan_has_another_journal() -> None:
    with open_journal(REQUESTS) as first, open_journal([replace(REQUESTS[0], size=(8, 8))]) as second:
        assert first.path != second.path


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("no folder")
    with pytest.raises(JournalError, match="set XDG_STATE_HOME"), open_journal(REQUESTS):
        pass


@pytest.fixture
def planned() -> list[str]:
    """`rayfarm study demo` on a small size."""
    return ["study", "demo", "--size", "8", "--frames", "2", "--rounds", "2", "--json"]


def journals(tmp_path: Path) -> list[str]:
    return sorted(path.suffix for path in (tmp_path / "state" / "rayfarm" / "studies").iterdir())


def test_the_journal_goes_with_the_end(
    planned: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    monkeypatch.setattr(study_here, "run_slice", Slices(5))
    assert cli.run(planned) == 130
    assert "the same command goes on from here" in capsys.readouterr().err
    assert journals(tmp_path) == [".jsonl"]
    failing = Slices(failing="kd-backtrack")
    monkeypatch.setattr(study_here, "run_slice", failing)
    assert cli.run(planned) == 1
    said = capsys.readouterr()
    assert "5 of " in said.err
    assert "The stand-in fails." in said.err
    assert journals(tmp_path) == [".jsonl"]
    last = Slices()
    monkeypatch.setattr(study_here, "run_slice", last)
    assert cli.run(planned) == 0
    assert {traversal for _, traversal, _ in last.ran} == {"kd-backtrack"}
    assert journals(tmp_path) == []


def test_fresh_starts_anew(planned: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_here, "run_slice", Slices(3))
    assert cli.run(planned) == 130
    slices = Slices()
    monkeypatch.setattr(study_here, "run_slice", slices)
    assert cli.run([*planned, "--fresh"]) == 0
    assert len(slices.ran) >= 20


def test_pictures_lie_beside_the_journal(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(monkeypatch, Slices(1))
    with open_journal(REQUESTS) as journal:
        assert (journal.pictures / "picture.png").read_text() == "cornell-box"
        journal.start_anew()
        assert (len(journal), journal.pictures.exists()) == (0, False)


def test_what_a_journal_holds_is_on_the_disk() -> None:
    with open_journal(REQUESTS) as journal:
        journal.keep(REQUESTS[0], 0, Kept(1.0, {"frames": [float("nan")]}))
        assert journal.path.read_bytes().endswith(b"}\n")
        assert isinstance(journal, Journal)


def test_the_study_paper_ends_in_its_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("RAYFARM_SCENES", raising=False)
    slices = Slices()
    monkeypatch.setattr(study_here, "run_slice", slices)
    assert cli.run(["study", "paper", "--size", "8", "--json"]) == 0
    said = capsys.readouterr()
    assert len(said.out.splitlines()) * 4 == len(slices.ran)
    assert "The report is rayfarm-paper.html; of the paper's" in said.err
    assert "<html" in (tmp_path / "rayfarm-paper.html").read_text(encoding="utf-8")
    assert journals(tmp_path) == []
