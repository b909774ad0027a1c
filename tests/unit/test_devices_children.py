"""Child processes that any thread ends at once."""

from __future__ import annotations

import tempfile
import threading
from pathlib import Path

import pytest

from renderer.locks import holding, machine_lock
from server.devices.children import Children, Ended
from server.devices.examiner import HEALTH
from server.devices.registry import TWIN


def children_of_this_process() -> set[str]:
    return {pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()}


@pytest.fixture
def private_locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def test_a_check_that_waits_ends_with_its_tracker(private_locks: None) -> None:
    before, ended = children_of_this_process(), threading.Event()
    children = Children()

    def check() -> None:
        try:
            children.run(HEALTH, {"kind": TWIN}, 60.0)
        except Ended:
            ended.set()

    thread = threading.Thread(target=check)
    with holding(machine_lock()):
        thread.start()
        while not children_of_this_process() - before:
            assert thread.is_alive()
        children.end()
        thread.join(20)
    assert ended.is_set()
    assert children_of_this_process() - before == set()


def test_nothing_is_started_after_the_end() -> None:
    children = Children()
    children.end()
    with pytest.raises(Ended):
        children.run(HEALTH, {"kind": TWIN}, 60.0)
