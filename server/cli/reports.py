"""Studies that end in a report, and where it goes."""

from __future__ import annotations

from pathlib import Path

from server.cli.common import ClientError

REPORTS = {"paper": Path("rayfarm-paper.html"), "hard-cases": Path("rayfarm-hard-cases.html")}
"""Where each study's report goes by default."""


def report_path(name: str, given: Path | None) -> Path | None:
    """Where a study's report goes, None for one that has none; raise ClientError where it cannot be written."""
    if name not in REPORTS:
        if given is not None:
            raise ClientError(f"Only the studies {' and '.join(REPORTS)} have a report: leave out --report.")
        return None
    path = given or REPORTS[name]
    if path.is_dir() or not path.parent.is_dir():
        raise ClientError(f"The report cannot be written to {path}: give --report a file in a folder that exists.")
    return path
