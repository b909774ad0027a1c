"""The models that stand beside a measurement where the device has no counters: memory lines, ALU operations, and
estimates by compilers for phone GPUs."""

from __future__ import annotations

from typing import Any

from renderer.alu.model import alu_model
from renderer.host import Host
from renderer.memory.lines import model_lines
from renderer.phone_compile.model import compiled_model
from renderer.plan import Plan
from renderer.prepare import Prepared
from renderer.records import Records


def run_models(prepared: Prepared, timed: Plan, records: Records, host: Host) -> tuple[float | None, dict[str, Any]]:
    """The lines a ray, None where they are not modelled, and the result's `model`.

    `records` are those of the instrumented plan of the same request. The machine's lock must be held: the reads are
    recorded here, on the twin, whose device is the machine.
    """
    lines = model_lines(prepared, host)
    alu = alu_model(timed, prepared, records)
    return lines.per_ray, {
        "lines": lines.as_dict(),
        "alu_per_fragment": alu.per_fragment,
        "alu_per_ray": alu.per_ray,
        "alu_text": alu.text,
        "compiled": compiled_model(prepared, timed, records, host),
    }
