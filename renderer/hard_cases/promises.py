"""What must hold of every cell, and what is known to be lost where (`docs/hard_cases.md` gives the reasons)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from renderer.hard_cases.cell import FAULTS
from renderer.variant import CONSERVATIVE_NODES, TRAVERSALS
from scenes.hard_cases import FAMILIES

Json = dict[str, Any]

FALSE = ("false_hit", "false_miss", "any_false_hit", "any_false_miss", "wrong_primitive")

TOO_SHORT = "a ray whose every component is below 2^-80 counts as still"
ABSURD = "products of coordinates from 2^-126 to 2^127 leave float32 in ways that the bound does not follow"
NO_AREA = "the papers' test takes triangles without area for some that have"
KNOWN: dict[str, str] = {
    "extreme-lengths": TOO_SHORT,
    "garbage-rays": TOO_SHORT,
    "garbage-finite": ABSURD,
    "garbage-corners": ABSURD,
    "garbage-bits": ABSURD,
}
"""Families in which float32 answers may be false, whatever the variant, and why."""

FAR_EYE = "far-eye"
"""Where a KD walk may answer another of several triangles that t cannot tell apart."""


def broken(rows: Iterable[Json]) -> list[str]:
    """One sentence for each promise that a row breaks."""
    return [f"{row['label']} on {row['family']}: {what}" for row in rows for what in _broken(row)]


def exact_boxes(row: Json) -> bool:
    """Whether no box of the variant can lose a hit: 16-bit arithmetic can, wherever a device has it."""
    variant = row["variant"]
    conservative = variant["box"] == "widened" and variant["nodes"] in CONSERVATIVE_NODES
    return conservative and variant["precision"] == "highp"


def _broken(row: Json) -> Iterator[str]:
    if row["outcome"] in ("crashed", "hung"):
        yield f"{row['outcome']}. {row['sentence']}"
    if row["outcome"] != "ran":
        return
    yield from (f"{row[name]} {name}" for name in FAULTS if row[name])
    if row["fitted"] is False:
        yield "the specialised text gives other bits"
    bar = FAMILIES[row["family"]].bar
    if bar is not None and row["cost"] is not None and row["cost"] > bar:
        yield f"a ray costs {row['cost']:.1f} times an ordinary one, the bar is {bar:g}"
    if exact_boxes(row):
        yield from _lost(row)
    if row["variant"]["offset"] == "bounded" and row["variant"]["precision"] == "highp":
        yield from (
            f"{row[name]} {name} of {row['spawned']} spawned" for name in ("self_hit", "unexpected") if row[name]
        )


def _lost(row: Json) -> Iterator[str]:
    """What a variant loses whose boxes lose nothing."""
    variant = row["variant"]
    kd = TRAVERSALS[variant["traversal"]].structure == "kd"
    if row["differs"] and not (kd and row["family"] == FAR_EYE):
        yield f"{row['differs']} answers differ from the reference's"
    if variant["intersector"] == "watertight" and row["hole"]:
        yield f"{row['hole']} holes"
    if row["family"] not in KNOWN and variant["intersector"] != "baked":
        yield from (f"{row[name]} {name}" for name in FALSE if row[name])
