"""A study of hard cases as one document: made here by the CLI, checked where a service takes one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from renderer.hard_cases.cell import Outcome
from renderer.hard_cases.promises import breaches, broken, kept
from renderer.hard_cases.study import Order, Ran
from renderer.hard_cases.versions import versions
from scenes.hard_cases import FAMILIES

Json = dict[str, Any]
NAME = "hard-cases"
MOST_CELLS = 100_000
Word = Annotated[str, Field(min_length=1, max_length=200)]
Sentence = Annotated[str, Field(max_length=2000)]
Count = Annotated[int, Field(ge=0)]


def study_document(order: Order, ran: Ran, started: datetime, seconds: float) -> Json:
    """The study as one plain document: what was run on what, the families, every cell, the promises kept and broken."""
    families = [
        {"name": name, "reason": FAMILIES[name].reason, "source": FAMILIES[name].source, "bar": FAMILIES[name].bar}
        for name in order.families
    ]
    return {
        "study": NAME,
        "seed": order.seed,
        "share": order.share,
        "started_at": started.isoformat(timespec="seconds"),
        "seconds": round(seconds, 1),
        "device": ran.device,
        "versions": versions(),
        "families": families,
        "promises": kept(ran.rows),
        "cells": [row | {"broken": [what for _, what in breaches(row)]} for row in without_infinity(ran.rows)],
        "broken": broken(ran.rows),
    }


def without_infinity(rows: Sequence[Json]) -> list[Json]:
    """Rows with null for every float that JSON cannot hold."""
    return [
        {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in row.items()}
        for row in rows
    ]


class FamilyPart(BaseModel):
    """A family of rays, why it is there and where it is from; `bar` is how many ordinary rays one may cost."""

    model_config = ConfigDict(extra="forbid")

    name: Word
    reason: Sentence
    source: Sentence
    bar: float | None = None


class PromisePart(BaseModel):
    """What must hold, of which variants, against how many cells it was held and how many broke it."""

    model_config = ConfigDict(extra="forbid")

    name: Word
    what: Sentence
    of: Sentence
    cells: Count
    broken: Count


class CellPart(BaseModel):
    """One variant on one family, as `renderer.hard_cases.cell` has it: every further field is a count."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Count | None]

    variant: dict[Word, Word]
    label: Sentence
    family: Word
    seed: int
    outcome: Outcome
    sentence: Sentence = ""
    rays: Count
    t_ulp_max: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    cost: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    fitted: bool | None = None
    broken: list[Sentence] = []


class Document(BaseModel):
    """A whole study; what documents of earlier versions lack is null or empty."""

    model_config = ConfigDict(extra="forbid")

    study: Literal["hard-cases"]
    seed: int
    share: Annotated[float, Field(gt=0, le=1)]
    started_at: datetime | None = None
    seconds: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None
    device: dict[Word, str | int | float | None] | None = None
    versions: dict[Word, str | int] = {}
    families: Annotated[list[FamilyPart], Field(min_length=1, max_length=1000)]
    promises: list[PromisePart] = []
    cells: Annotated[list[CellPart], Field(min_length=1, max_length=MOST_CELLS)]
    broken: list[Sentence]

    @model_validator(mode="after")
    def _fits_together(self) -> Document:
        known = {family.name for family in self.families}
        axes = self.cells[0].variant.keys()
        for cell in self.cells:
            if cell.family not in known:
                raise ValueError(f"A cell is of the family {cell.family!r}, which families does not list.")
            if cell.variant.keys() != axes:
                raise ValueError(f"The variant {cell.label!r} has other axes than the first cell's.")
        return self
