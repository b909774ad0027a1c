"""Words to a phone's shell, profiles in a bounded child, paths; and docs/security.md, whose tests all exist."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from test_phone_words import HOSTILE

from server.devices.adb import Phone
from server.devices.wire import Wire
from server.profiles import child
from server.profiles.errors import ProfileError
from server.profiles.reader import read_profile

ROOT = Path(__file__).parents[2]
FIXTURES = ROOT / "tests/fixtures/profiles"
WORDS = [*(word for word in HOSTILE if "\0" not in word), "'; touch owned #", "$(touch owned)", "a\\", "*", "--", "%s"]


def test_every_test_that_the_threat_model_names_exists() -> None:
    table = [line for line in (ROOT / "docs/security.md").read_text().splitlines() if line.startswith("| ")]
    threats = [line for line in table if "`test_" in line]
    assert len(threats) > 20
    known = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        known |= set(re.findall(r"^def (test_\w+)", path.read_text(), re.MULTILINE))
    for line in threats:
        assert set(re.findall(r"`(test_\w+)`", line)) <= known, line


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


def test_a_child_reads_what_this_process_reads() -> None:
    for name in ("perfetto.csv", "snapdragon_realtime.csv"):
        assert child.read_in_child(FIXTURES / name) == read_profile(FIXTURES / name)


@pytest.mark.parametrize(("name", "value"), [("MEMORY", 200 << 20), ("TIMEOUT_S", 0.01)])
def test_a_profile_that_takes_too_much_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, value: Any) -> None:
    monkeypatch.setattr(child, name, value)
    with pytest.raises(ProfileError, match="too much memory or time"):
        child.read_in_child(FIXTURES / "perfetto.csv")
