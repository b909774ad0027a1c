"""Runs a request's instrumented plan: the rays as cast, what they hit, and what it took."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.host import Tile
from renderer.plan import Plan, PlanError
from renderer.prepare import Prepared
from renderer.readback import read_records
from renderer.records import Records


class CutShortError(PlanError):
    """Loops that the device stopped before they were done."""


def records_of(prepared: Prepared, plan: Plan, tiles: Sequence[Tile]) -> Records:
    """The records of one image from an instrumented plan's tiles; raise CutShortError when any ray was cut short."""
    hybrid = prepared.request.variant.method == "hybrid"
    records = read_records(plan.size, plan.tile, len(prepared.scene.lights), tiles, rasterised=hybrid)
    refuse_cut(int(records.cut.sum()))
    return records


def refuse_cut(pixels: int) -> None:
    """Raise CutShortError if any pixel was cut short."""
    if pixels:
        raise CutShortError(
            f"{pixels} pixels were cut short: the device stopped their loops before they were done (Mesa 22 stops an "
            "invocation after 65,535 iterations), so the run does not count; use another traversal or smaller leaves."
        )
