"""What must hold of every cell, and what is known to be lost where (`docs/hard_cases.md` gives the reasons)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from renderer.hard_cases.cell import FAULTS
from renderer.variant import CONSERVATIVE_NODES, TRAVERSALS
from scenes.hard_cases import FAMILIES

Json = dict[str, Any]

FALSE = ("false_hit", "false_miss", "any_false_hit", "any_false_miss", "wrong_primitive")

TOO_SHORT = "a ray whose every component is below 2^-80 counts as still"
ABSURD = "products of coordinates from 2^-126 to 2^127 leave float32 in ways that the bound does not follow"
GARBAGE_RAYS = "garbage-rays"
KNOWN: dict[str, str] = {
    "extreme-lengths": TOO_SHORT,
    GARBAGE_RAYS: TOO_SHORT,
    "garbage-finite": ABSURD,
    "garbage-corners": ABSURD,
    "garbage-bits": ABSURD,
}
"""Families in which float32 answers may be false, whatever the variant, and why."""

FAR_EYE = "far-eye"
"""Where a KD walk may answer another of several triangles that t cannot tell apart."""


@dataclass(frozen=True)
class Promise:
    """What must hold of every row that it `covers`; `breaks` gives one phrase for each way in which it does not."""

    name: str
    what: str
    of: str
    covers: Callable[[Json], bool]
    breaks: Callable[[Json], Iterator[str]]


def exact_boxes(row: Json) -> bool:
    """Whether no box of the variant can lose a hit: 16-bit arithmetic can, wherever a device has it."""
    variant = row["variant"]
    conservative = variant["box"] == "widened" and variant["nodes"] in CONSERVATIVE_NODES
    return conservative and variant["precision"] == "highp"


def _ran(row: Json) -> bool:
    return bool(row["outcome"] == "ran")


def _counted(*names: str) -> Callable[[Json], Iterator[str]]:
    """Counts that must be 0, where they were taken."""
    return lambda row: (f"{row[name]} {name}" for name in names if row[name])


def _faults(row: Json) -> Iterator[str]:
    if not _ran(row):
        yield f"{row['outcome']}. {row['sentence']}"
    else:
        yield from _counted(*FAULTS)(row)


def _too_dear(row: Json) -> Iterator[str]:
    bar = FAMILIES[row["family"]].bar
    if bar is not None and row["cost"] > bar:
        yield f"a ray costs {row['cost']:.1f} times an ordinary one, the bar is {bar:g}"


def _other_bits(row: Json) -> Iterator[str]:
    if row["fitted"] is False:
        yield "the specialised text gives other bits"


def _differs(row: Json) -> Iterator[str]:
    if row["differs"]:
        yield f"{row['differs']} answers differ from the reference's"


def _starts_wrong(row: Json) -> Iterator[str]:
    return (f"{row[name]} {name} of {row['spawned']} spawned" for name in ("self_hit", "unexpected") if row[name])


def _is_exact(row: Json) -> bool:
    return _ran(row) and exact_boxes(row)


def _must_agree(row: Json) -> bool:
    kd = TRAVERSALS[row["variant"]["traversal"]].structure == "kd"
    return _is_exact(row) and row["differs"] is not None and not (kd and row["family"] == FAR_EYE)


def _must_be_right(row: Json) -> bool:
    return _is_exact(row) and row["family"] not in KNOWN and row["variant"]["intersector"] != "baked"


def _must_be_closed(row: Json) -> bool:
    return _is_exact(row) and row["variant"]["intersector"] == "watertight" and row["hole"] is not None


def _must_be_cheap(row: Json) -> bool:
    """In 16 bits a garbage ray's slabs are no numbers, and it enters every box."""
    known = row["family"] == GARBAGE_RAYS and row["variant"]["precision"] != "highp"
    return _ran(row) and FAMILIES[row["family"]].bar is not None and row["cost"] is not None and not known


def _must_leave(row: Json) -> bool:
    variant = row["variant"]
    bounded = variant["offset"] == "bounded" and variant["precision"] == "highp"
    return _ran(row) and bounded and row["spawned"] is not None


PROMISES = (
    Promise(
        "answers",
        "no NaN, nothing cut, no bound passed, no crash, no hang",
        "all",
        lambda row: row["outcome"] in ("ran", "crashed", "hung"),
        _faults,
    ),
    Promise(
        "cost",
        "rays of NaN and infinity cost at most 2.5 ordinary rays",
        f"all; in 16-bit arithmetic but for {GARBAGE_RAYS}",
        _must_be_cheap,
        _too_dear,
    ),
    Promise(
        "specialised",
        "the specialised text gives the same bits",
        "all, on a sample of families",
        lambda row: _ran(row) and row["fitted"] is not None,
        _other_bits,
    ),
    Promise(
        "bits",
        "no answer differs from the reference's",
        f"widened boxes, conservative nodes; KD walks but for {FAR_EYE}",
        _must_agree,
        _differs,
    ),
    Promise(
        "right",
        "no false hit, no false miss, no wrong primitive",
        "widened boxes, conservative nodes, not baked; not in families whose numbers leave float32",
        _must_be_right,
        _counted(*FALSE),
    ),
    Promise("closed", "no hole", "watertight, widened boxes, conservative nodes", _must_be_closed, _counted("hole")),
    Promise(
        "offset",
        "no self-hit, nothing unexpected",
        "offset bounded, highp",
        _must_leave,
        _starts_wrong,
    ),
)


def breaches(row: Json) -> list[tuple[str, str]]:
    """The promises that a row breaks, by name, each with a phrase."""
    return [(promise.name, what) for promise in PROMISES if promise.covers(row) for what in promise.breaks(row)]


def broken(rows: Iterable[Json]) -> list[str]:
    """One sentence for each promise that a row breaks."""
    return [f"{row['label']} on {row['family']}: {what}" for row in rows for _, what in breaches(row)]


def kept(rows: Sequence[Json]) -> list[Json]:
    """Every promise with the number of cells that it was held against, and of those that broke it."""
    return [
        {
            "name": promise.name,
            "what": promise.what,
            "of": promise.of,
            "cells": sum(promise.covers(row) for row in rows),
            "broken": sum(promise.covers(row) and any(promise.breaks(row)) for row in rows),
        }
        for promise in PROMISES
    ]
