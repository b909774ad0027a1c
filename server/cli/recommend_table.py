"""A recommendation in the terminal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

Json = dict[str, Any]
SHOWN = 10


def print_recommendation(found: Json, console: Console) -> None:
    """Print the verdict, the finalists, and what was given up and why."""
    width, height = found["size"]
    console.print(Text(found["verdict"], style="bold"))
    console.print(
        Text(
            f"{found['scene']}: {found['triangles']:,} triangles, {width}x{height}, {found['rays_kind']} rays, "
            f"{found['device']['name']}; at most {found['error_budget']:g} of the rays wrong"
            + (f", {found['memory_budget'] / 1e6:.1f} MB" if found["memory_budget"] else "")
            + f"; seed {found['seed']}"
        )
    )
    if found["finalists"]:
        console.print(_finalists(found))
        console.print(Text(_words_on_interval(found), style="dim"))
    _print_pilot(found, console)
    _print_left_out(found, console)
    took = ", ".join(f"{part} {seconds:.1f} s" for part, seconds in found["took_s"].items())
    console.print(Text(f"It took: {took}.", style="dim"))


def _finalists(found: Json) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("variant", no_wrap=True)
    for head in ("frame ms", "Mray/s", "times the pick", "interval", "wrong", "memory"):
        table.add_column(head, justify="right", no_wrap=True)
    for one in found["finalists"]:
        rate = one["mrays_per_s"]
        cells = (
            f"{one['frame_ms']:.4g}",
            "–" if rate is None else f"{rate:.3g}",
            f"{one['ratio']:.3f}",
            "–" if one["low"] is None or one is found["finalists"][0] else f"{one['low']:.3f}–{one['high']:.3f}",
            f"{one['wrong']:.1e}",
            f"{one['memory_bytes'] / 1e6:.1f} MB",
        )
        table.add_row(Text(one["label"]), *map(Text, cells))
    return table


def _words_on_interval(found: Json) -> str:
    clock = "processor" if found["clock"] == "cpu" else "wall"
    return f"{found['rounds']} rounds, {clock} time; the intervals hold together with 95 % confidence."


def _print_pilot(found: Json, console: Console) -> None:
    steps = [
        f"{rung['measured']} at {rung['size'][0]}x{rung['size'][1]}, {rung['kept']} kept" for rung in found["pilot"]
    ]
    if steps:
        console.print(Text(f"Pilot: {'; '.join(steps)}."))
    gone = sorted(found["eliminated"], key=lambda one: (-one["size"][0] * one["size"][1], one["ratio"]))
    for title, ones in (("Not told apart in the pilot", found["unconfirmed"]), ("Clearly slower", gone)):
        if ones:
            console.print(Text(f"{title}:"))
            console.print(_ratios(ones))


def _ratios(ones: Sequence[Json]) -> Table:
    table = Table(box=None, show_header=False)
    for one in ones[:SHOWN]:
        size = f"{one['size'][0]}x{one['size'][1]}"
        ratio = f"{one['ratio']:.2f} ({one['low']:.2f}–{one['high']:.2f})"
        table.add_row(Text(one["label"]), Text(ratio), Text(f"of {one['leader']} at {size}"))
    if len(ones) > SHOWN:
        table.add_row(Text(f"and {len(ones) - SHOWN} more: --json lists all"))
    return table


def _print_left_out(found: Json, console: Console) -> None:
    reasons: dict[str, list[str]] = defaultdict(list)
    for one in found["over_error"]:
        reasons["over the error budget"].append(f"{one['label']} ({one['wrong']:.1e} of {one['rays']:,} rays)")
    for one in found["over_memory"]:
        reasons["over the memory budget"].append(f"{one['label']} ({one['memory_bytes'] / 1e6:.1f} MB)")
    for one in found["unable"]:
        reasons[f"could not run: {one['reason']}"].append(one["label"])
    for one in found["same"]:
        reasons["the same program and data as another"].append(f"{one['label']} (as {one['as']})")
    for reason, names in reasons.items():
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        console.print(Text(f"Left out, {reason}: {', '.join(names[:SHOWN])}{more}."))
    for reason in dict.fromkeys(one["reason"] for one in found.get("refused", ())):
        number = sum(one["reason"] == reason for one in found["refused"])
        console.print(Text(f"Left out, {number} combinations: {reason}"))
