"""`rayfarm doctor`: what is missing on this machine, and how to mend it."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from importlib import import_module
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from server.cli.common import SOME_FAILED, JsonFlag, make_console, print_json

if TYPE_CHECKING:
    from server.doctor.finding import Finding

CHECKS = {
    "python": ("packages", "python"),
    "packages": ("packages", "packages"),
    "programs": ("packages", "programs"),
    "graphics": ("graphics", "graphics"),
    "folders": ("folders", "folders"),
    "scenes": ("folders", "scenes"),
    "database": ("store", "database"),
    "tokens": ("store", "tokens"),
    "adb": ("phones", "adb"),
    "usb": ("phones", "usb"),
    "agent": ("phones", "agent"),
    "compilers": ("phones", "phone_compilers"),
}
ASKED = {"service": ("service", "service"), "worker": ("service", "worker")}
"""Checks of what runs, made only where they are named: health checks are these."""
MARKS = {"good": ("ok", "green"), "note": ("note", "yellow"), "missing": ("MEND", "red")}


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command()(doctor)


def doctor(
    checks: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CHECK]...", help=f"{', '.join([*CHECKS, *ASKED])}; all but the last two by default."),
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Say what is missing on this machine and how to mend it; the exit code is 1 when something must be mended."""
    unknown = next((name for name in checks or () if name not in CHECKS | ASKED), None)
    if unknown is not None:
        raise typer.BadParameter(f"There is no check {unknown[:40]!r}: choose from {', '.join(CHECKS | ASKED)}.")
    found = [finding for name in checks or CHECKS for finding in _made(name)]
    if as_json:
        print_json({"findings": [asdict(finding) for finding in found]})
    else:
        _show(found)
    if any(finding.state == "missing" for finding in found):
        raise typer.Exit(SOME_FAILED)


def _made(name: str) -> list[Finding]:
    """One check; one that breaks is a finding of its own, and the others are still made."""
    from server.doctor.finding import findings
    from server.spoken import spoken

    module, function = (CHECKS | ASKED)[name]
    try:
        return findings(name, getattr(import_module(f"server.doctor.{module}"), function)())
    except ImportError as error:
        return findings(name, [("missing", f"{error.name} cannot be loaded ({error}): run `make` again.")])
    except Exception as error:
        sentence = spoken(error) or f"This could not be checked: {type(error).__name__}: {error}."
        return findings(name, [("missing", sentence)])


def _show(found: list[Finding]) -> None:
    console = make_console()
    for finding in found:
        word, colour = MARKS[finding.state]
        console.print(Text.assemble((f"{word:5}", colour), f"{finding.check:10} ", finding.sentence), soft_wrap=True)
    count = Counter(finding.state for finding in found)
    console.print(f"{count['missing']} to mend, {count['note']} to note, {count['good']} good.")
