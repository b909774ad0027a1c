"""Studies of hard cases as their documents, made without a GPU."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from renderer.hard_cases.cell import FAULTS, WRONG, Cell
from renderer.hard_cases.study import Order, Ran
from renderer.variant import Variant
from server.hard_cases.document import study_document

Json = dict[str, Any]
FAMILIES = ("nan-origin", "pbrt-vertices", "reintersect", "stadium", "garbage-bits")
DEVICE = {"id": "llvmpipe", "kind": "twin", "name": "llvmpipe (test)", "driver": "4.5 Mesa", "threads": 1, "cores": 2}
PLAIN = Variant("bvh-stack", "compute")
VARIANTS = (
    PLAIN,
    Variant("kd-backtrack", "compute"),
    replace(PLAIN, intersector="watertight"),
    replace(PLAIN, box="williams"),
    replace(PLAIN, offset="bounded"),
)


def study(seed: int = 5, *, device: Json | None = None, changed: dict[str, Json] | None = None) -> Json:
    """A document of five variants on five families; `changed` gives cells of a family other fields, as
    `{"stadium": {"nan": 3}}` for `bvh-stack` alone."""
    rows = [_row(variant, family, seed) for variant in VARIANTS for family in FAMILIES if _meets(variant, family)]
    for row in rows:
        if row["variant"] == PLAIN.as_dict():
            row.update((changed or {}).get(row["family"], {}))
    order = Order(VARIANTS, FAMILIES, seed=seed)
    document = study_document(order, Ran(rows, device or DEVICE), datetime(2026, 1, 2, 3, 4, tzinfo=UTC), 61.25)
    return json.loads(json.dumps(document))  # type: ignore[no-any-return]


def _meets(variant: Variant, family: str) -> bool:
    return variant.offset == "constant" or family == "reintersect"


def _row(variant: Variant, family: str, seed: int) -> Json:
    if family == "garbage-bits":
        return Cell(variant, family, seed, "refused", "Some coordinates are not finite numbers.", 64).to_json()
    counts: dict[str, int | None] = dict.fromkeys((*WRONG, *FAULTS, "edge", "any_edge", "differs", "spawned"), 0)
    if family == "pbrt-vertices" and variant.intersector != "watertight":
        counts |= {"hole": 630 if variant.structure == "bvh" else 636, "edge": 1057}
    if family == "reintersect":
        counts |= {"spawned": 4096, "self_hit": 0 if variant.offset == "bounded" else 12}
    return Cell(variant, family, seed, "ran", "", 8192, counts, 3282.25, 1.25, family == "stadium" or None).to_json()
