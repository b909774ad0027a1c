"""Runs a request's instrumented plan: the rays as cast, what they hit, and what it took."""

from __future__ import annotations

from typing import Any

from renderer.plan import PlanError
from renderer.prepare import Prepared
from renderer.readback import read_records
from renderer.records import Records
from renderer.twin import Twin


class CutShortError(PlanError):
    """Loops that the device stopped before they were done."""


def instrumented(prepared: Prepared, context: Any) -> Records:
    """The records of one image on a moderngl `context`; raise CutShortError when the device cut any ray short."""
    plan = prepared.plan(instrument=True)
    twin = Twin(context, plan)
    twin.setup()
    hybrid = prepared.request.variant.method == "hybrid"
    records = read_records(plan.size, plan.tile, len(prepared.scene.lights), twin.collect(), rasterised=hybrid)
    twin.release()
    refuse_cut(int(records.cut.sum()))
    return records


def refuse_cut(pixels: int) -> None:
    """Raise CutShortError if any pixel was cut short."""
    if pixels:
        raise CutShortError(
            f"{pixels} pixels were cut short: the device stopped their loops before they were done (Mesa 22 stops an "
            "invocation after 65,535 iterations), so the run does not count; use another traversal or smaller leaves."
        )
