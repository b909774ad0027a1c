"""Fetching adbd: once, beside the system, and with a clear sentence where it cannot be had."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from agent_android.standin import packages
from agent_android.standin.errors import StandInUnavailableError


@pytest.fixture
def nothing_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(packages, "cache", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def test_a_machine_without_the_suite_is_told_so(nothing_cached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages, "_archives", list)
    with pytest.raises(StandInUnavailableError, match="no apt source here has the suite bookworm"):
        packages.ensure()
    assert not list(nothing_cached.glob("adbd-*"))


def test_an_archive_that_fails_is_quoted(nothing_cached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages, "_archives", lambda: ["file:/nowhere"])
    with pytest.raises(StandInUnavailableError, match=r"E: .*Name the Debian archive"):
        packages.ensure()
    assert not list(nothing_cached.glob("adbd-*"))


def test_a_machine_without_apt_is_told_so(nothing_cached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages, "PROGRAMS", ("apt-get", "no-such-program"))
    with pytest.raises(StandInUnavailableError, match="missing: no-such-program"):
        packages.ensure()


def test_what_was_fetched_is_used_without_apt(monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        unpacked = packages.ensure()
    except StandInUnavailableError as unavailable:
        pytest.skip(str(unavailable))

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a program was run")

    monkeypatch.setattr(subprocess, "run", refuse)
    assert packages.ensure() == unpacked
