"""What one frame of a variant does, counted on llvmpipe once for all GPUs: sites, rays, bytes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from renderer.alu.facts import counted
from renderer.host import Host
from renderer.instrumented import records_of
from renderer.phone_compile.errors import CompileError
from renderer.phone_compile.sites import Where, executions
from renderer.plan import Plan, Program
from renderer.planner import in_passes
from renderer.prepare import Prepared
from renderer.records import Records


@dataclass(frozen=True)
class Frame:
    """Executions of each site, runs of the program, pixels, rays that are timed, and bytes fetched for these."""

    sites: Mapping[Where, int]
    runs: int
    pixels: int
    rays: int
    bytes: float


def tracing_program(plan: Plan) -> tuple[Program, str]:
    """The program that traces rays in every frame and its stage; raise CompileError where there is more than one."""
    found = plan.tracing()
    if len(found) != 1:
        raise CompileError(f"The plan traces its rays in {len(found)} programs a frame, and the estimate covers one.")
    return found[0]


def count_frame(prepared: Prepared, timed: Plan, host: Host, records: Records | None = None) -> Frame:
    """Count one frame of a timed plan; the device's lock must be held. `records` are of the instrumented plan, which
    is run where they are not given."""
    if in_passes(prepared.scene, prepared.tree):
        raise CompileError("Brute force runs in passes on this scene, which carry no counters.")
    program, stage = tracing_program(timed)
    if records is None:
        instrumented = prepared.plan(instrument=True)
        records = records_of(prepared, instrumented, host.collect(instrumented))
    known = counted(prepared, records)
    sites = executions(timed, program, stage, host)
    return Frame(sites, known.runs, known.pixels, known.rays, known.steps["words"] * 4.0)
