"""The report of the study `paper`: where it goes, and its writing from results here or on a service."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from server.cli.common import Client, ClientError

if TYPE_CHECKING:
    from server.paper.judging import Verdicts

Json = dict[str, Any]
Pictures = Callable[[str], bytes | None]


@dataclass(frozen=True)
class Written:
    """A report that was written: its verdicts, and one sentence about it."""

    verdicts: Verdicts
    text: str


def report_here(documents: Sequence[Json], pictures: Path, path: Path) -> Written:
    """Write the report of results whose pictures are in a folder."""
    from server.paper.report import pictures_in

    return _write(documents, pictures_in(pictures), path)


def report_there(client: Client, study: int, path: Path) -> Written:
    """Write the report of a service's study."""

    def pictures(digest: str) -> bytes | None:
        try:
            return client.get_bytes(f"pictures/{digest}")
        except ClientError as error:
            if error.__cause__ is not None:  # No answer at all; a refusal says that the picture is not there.
                raise
            return None

    return _write(client.get("results", [("of", f"study:{study}")])["results"], pictures, path)


def _write(documents: Sequence[Json], pictures: Pictures, path: Path) -> Written:
    from server.paper.report import write_report

    try:
        verdicts = write_report(documents, pictures, path)
    except OSError as error:
        raise ClientError(f"The report cannot be written to {path}: {error.strerror or error}.") from error
    judged = Counter(verdict.outcome for verdict in verdicts)
    counts = ", ".join(f"{number} {outcome}" for outcome, number in judged.items())
    return Written(verdicts, f"The report is {path}; of the paper's {len(verdicts)} claims: {counts}.")


def print_verdicts(verdicts: Verdicts, console: Console) -> None:
    """The claims and verdicts as a table in the terminal."""
    table = Table("Claim", "Paper", "Verdict", "Figures behind it")
    for verdict in verdicts:
        claim = verdict.claim
        texts = (claim.text, f"{claim.where}, figure {claim.figure}", verdict.outcome, verdict.finding.reason)
        table.add_row(*map(Text, texts))
    console.print(table)
