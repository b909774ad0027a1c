"""`rayfarm compare --baseline A --against B`: two sets of results, pair by pair, with verdicts."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from server.cli.common import SOME_FAILED, Client, ClientError, make_console, print_json
from server.comparison.differences import CLOCKS, Differences, Pair, differences_view, find_differences
from server.comparison.figures import write_percent
from server.comparison.sides import Side, choose, compared_names, read_results, read_side

STYLES = {"faster": "green", "slower": "red", "no difference found": "", "undecided": "yellow"}
APART = "The two were measured one after the other: what changed on the machine in between counts as a difference."
FEW_ROUNDS = "No interval: it takes at least 4 rounds a side; measure with --rounds 10 or more."


def compare_sides(
    baseline: str | None,
    against: str | None,
    threshold: float,
    gate: bool,
    clock: str,
    server: str | None,
    as_json: bool,
) -> int:
    """Print how `against` stands to `baseline`; the exit code.

    With `gate` it is 1 where the lower bound of a pair's slowdown passes `threshold`, in per cent; else always 0.
    """
    if not (baseline and against):
        raise ClientError("A comparison of two takes both --baseline and --against, as job:1 and job:2.")
    if not 0 <= threshold <= 1000:
        raise ClientError(f"The threshold is {threshold}: give a percentage from 0 to 1000.")
    if clock not in CLOCKS:
        raise ClientError(f"Unknown clock {clock!r}: choose one of {', '.join(CLOCKS)}.")
    sides = (read_side(baseline), read_side(against))
    first, second = (_load(side, server) for side in sides)
    found = find_differences(first, second, compared_names(*sides), clock)
    margin = threshold / 100
    if not found.pairs:
        raise ClientError("No result of one side has a partner on the other: compare the same scene, size and rays.")
    if as_json:
        print_json(differences_view(found, margin))
    else:
        print_differences(found, make_console())
        if gate:
            _print_gate(found, margin, make_console())
    return SOME_FAILED if gate and found.slower(margin) else 0


def print_differences(found: Differences, console: Console) -> None:
    """Print a line a pair, then what stands alone and what else must be known."""
    table = Table(title="Frame time, against by baseline: above 1 is slower", title_justify="left")
    for name in ("pair", "ratio", "95 % interval", "verdict", "smallest visible", "size", "hits"):
        table.add_column(name)
    for pair in found.pairs:
        table.add_row(*_cells(pair))
    console.print(table)
    for line in dict.fromkeys(_notes(found)):
        console.print(Text(line, style="yellow"))


def _load(side: Side, server: str | None) -> list[dict[str, Any]]:
    if side.kind == "file":
        return choose(side, read_results(side.path))
    with Client(server) as client:
        results: list[dict[str, Any]] = client.get("results", [("of", side.text)])["results"]
        return results


def _cells(pair: Pair) -> list[Text]:
    found = pair.difference
    visible = "" if found.visible is None else write_percent(found.visible)
    interval = "" if found.low is None or found.high is None else f"{found.low:.3f}–{found.high:.3f}"
    size = "" if pair.beside.size is None else f"{pair.beside.size:.3f}"
    cells = [_name(pair), f"{found.ratio:.3f}", interval, found.verdict, visible, size, pair.beside.hits]
    return [Text(cell, style=STYLES[found.verdict] if cell == found.verdict else "") for cell in cells]


def _name(pair: Pair) -> str:
    """The scene, the variant where it is shared, and what is compared."""
    shown = ("scene", "device", "traversal", "method", "layout", "size")
    shared = ", ".join(pair.place[name] for name in shown if name in pair.place)
    changes = [f"{name} {first} → {second}" for name, (first, second) in pair.compared.items()]
    return "\n".join([shared, *changes, *pair.beside.notes])


def _notes(found: Differences) -> list[str]:
    notes = [
        f"{pair.place['scene']}: the environments differ in {name}: {first} → {second}."
        for pair in found.pairs
        for name, (first, second) in pair.environment.items()
    ]
    if any(pair.difference.low is None for pair in found.pairs):
        notes.append(FEW_ROUNDS)
    if any(pair.apart for pair in found.pairs):
        notes.append(APART)
    if any(pair.repeated for pair in found.pairs):
        older = sum(pair.repeated for pair in found.pairs)
        notes.append(f"{older} older results of the same set-ups are left out: the latest is compared.")
    alone = (("baseline", found.only_baseline), ("against", found.only_against))
    return notes + [f"Only in {side}: {', '.join(place.values())}." for side, places in alone for place in places]


def _print_gate(found: Differences, margin: float, console: Console) -> None:
    stopped, count = found.slower(margin), len(found.pairs)
    text = f"{len(stopped)} of {count} slower by more than {write_percent(margin)}"
    sure = sum(pair.difference.low is not None for pair in found.pairs)
    blind = "" if sure == count else f"; {count - sure} could not be judged"
    console.print(
        Text(f"Gate {'stopped' if stopped else 'passed'}: {text}{blind}.", style="red" if stopped else "bold")
    )
