"""Words to a phone's shell, profiles in a bounded child, paths; and pages whose tests all exist."""

from __future__ import annotations

import ast
import io
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
from test_phone_words import HOSTILE

from server.dashboard.templates import TEMPLATES
from server.devices.adb import Phone
from server.devices.wire import Wire
from server.devices.words import WordError
from server.profiles import child
from server.profiles.errors import ProfileError
from server.profiles.reader import read_profile

ROOT = Path(__file__).parents[2]
FIXTURES = ROOT / "tests/fixtures/profiles"
WORDS = [*(word for word in HOSTILE if "\0" not in word), "'; touch owned #", "$(touch owned)", "a\\", "*", "--", "%s"]


@pytest.mark.parametrize(("page", "least"), [("security", 25), ("farm", 12)])
def test_every_threat_and_fault_names_tests_that_exist(page: str, least: int) -> None:
    table = [line for line in (ROOT / f"docs/{page}.md").read_text().splitlines() if line.startswith("| ")]
    heads = [line for line in table if line.endswith("| tests |")]
    lines = table[table.index(heads[0]) + 1 :]
    threats = list(takewhile(lambda line: not re.match(r"\| (variable|scope) ", line), lines))
    assert len(threats) > least
    known = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        known |= set(re.findall(r"^def (test_\w+)", path.read_text(), re.MULTILINE))
    for line in threats:
        named = set(re.findall(r"`(test_\w+)`", line))
        assert named, line
        assert named <= known, line


def test_words_reach_a_shell_as_they_are(tmp_path: Path) -> None:
    sent: list[str] = []

    class Captured(Phone):
        @contextmanager
        def _open(self, service: str, doing: str) -> Iterator[Wire]:
            sent.append(service)
            yield None  # type: ignore[misc]

    script = r"""for word in "$@"; do printf '%s\0' "$word"; done"""
    with Captured("R58M123ABC").shell(script, *WORDS, doing="asking"):
        pass
    command = sent[0].removeprefix("shell,v2,raw:")
    said = subprocess.run(["sh", "-c", command], capture_output=True, cwd=tmp_path, check=True).stdout
    assert said.decode().split("\0")[:-1] == WORDS
    assert list(tmp_path.iterdir()) == []


def test_no_script_for_a_phone_is_put_together_from_words() -> None:
    """Scripts are texts of ours; words go beside them, quoted. One has the places of counters, which are ours too."""
    made: list[str] = []
    scripts = 0
    for path in (ROOT / "server").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args):
                continue
            if node.func.attr in ("run", "shell") and ast.unparse(node.func.value).endswith(("phone", "_phone")):
                scripts += 1
                if not isinstance(node.args[0], ast.Constant | ast.Name):
                    made.append(path.name)
    assert scripts > 10
    assert made == ["counters.py"]


@pytest.mark.parametrize("word", WORDS)
def test_a_phone_is_not_spoken_to_of_hostile_words(word: str) -> None:
    with pytest.raises(WordError):
        Phone(word)
    phone, path = Phone("R58M123ABC"), f"/data/local/tmp/{word}/.."
    with pytest.raises(WordError):
        phone.push(io.BytesIO(), path, "pushing")
    with pytest.raises(WordError):
        phone.pull(path, io.BytesIO(), "pulling", 1)


def test_nothing_makes_html_of_a_text() -> None:
    """Templates escape every value, scripts set texts: whatever a name is, and wherever it comes to stand."""
    ways = r"\|\s*safe\b|autoescape\s+false|innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\("
    pages = [path for kind in ("html", "js") for path in (ROOT / "server").rglob(f"*.{kind}")]
    assert len(pages) > 30
    assert [path.name for path in pages if re.search(ways, path.read_text())] == []
    marked = {path.name for path in (ROOT / "server").rglob("*.py") if "Markup(" in path.read_text()}
    assert marked == {"report.py"}  # The style and charts of the two reports of one file.
    assert TEMPLATES.env.autoescape is True


def test_a_child_reads_what_this_process_reads() -> None:
    for name in ("perfetto.csv", "snapdragon_realtime.csv"):
        assert child.read_in_child(FIXTURES / name) == read_profile(FIXTURES / name)


@pytest.mark.parametrize(("name", "value"), [("MEMORY", 200 << 20), ("TIMEOUT_S", 0.01)])
def test_a_profile_that_takes_too_much_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, value: Any) -> None:
    monkeypatch.setattr(child, name, value)
    with pytest.raises(ProfileError, match="too much memory or time"):
        child.read_in_child(FIXTURES / "perfetto.csv")
