"""A profiler's file read in a child process, whose memory and time are bounded (`python -m server.profiles.child`).

A file that brings the parser down brings the child down: the server says so and goes on.
"""

from __future__ import annotations

import resource
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from renderer.answering import Say, answer_task
from renderer.child import ChildError, run_child
from server.profiles.errors import ProfileError
from server.profiles.formats import AUTO
from server.profiles.names import Series
from server.profiles.reader import Imported, read_profile
from server.profiles.summary import Summary

MEMORY = 3 << 30
"""Bytes of address space, libraries included; reading takes some hundred MB however large the file is."""
TIMEOUT_S = 840.0


def read_in_child(path: Path, name: str = AUTO, column_map: Mapping[str, str] | None = None) -> Imported:
    """`read_profile` in a child; raise ProfileError also when it fails, or takes too much memory or time."""
    task = {"path": str(path), "format": name, "map": dict(column_map or {}), "memory": MEMORY}
    try:
        answer = run_child("server.profiles.child", task, threads=1, timeout_s=TIMEOUT_S)
    except ChildError as error:
        raise ProfileError("The file took too much memory or time to read: split it.") from error
    if "refused" in answer:
        raise ProfileError(answer["refused"])
    summaries = [Summary(**{**one, "series": Series(**one["series"])}) for one in answer["summaries"]]
    return Imported(answer["format"], answer["rows"], summaries)


def read(task: dict[str, Any], _say: Say) -> dict[str, Any]:
    """The child's work."""
    resource.setrlimit(resource.RLIMIT_AS, (task["memory"], task["memory"]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        return asdict(read_profile(Path(task["path"]), task["format"], task["map"] or None))
    except ProfileError as error:
        return {"refused": str(error)}


if __name__ == "__main__":
    answer_task(read)
