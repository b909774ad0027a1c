"""A compiled variant as a result, in the form of `renderer.bench`: nothing of it was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from renderer.request import Request

Json = dict[str, Any]

COMPILERS = "mesa-compilers"
"""The device of results that were only compiled."""

KEPT = (
    "alu_per_fragment", "memory_per_fragment", "instructions", "registers", "waves", "spills", "text",
)  # fmt: skip
"""What a result's `model` keeps of an estimate, under the GPU's name."""


def model_of(rows: Sequence[Mapping[str, Any]]) -> Json:
    """The estimates by GPU (`adreno_540`, as columns have no hyphens), for a result's `model.compiled`."""
    return {row["gpu"].replace("-", "_"): {name: row[name] for name in KEPT} for row in rows}


def result_of(request: Request, measurement: Json) -> Json:
    """The result of a job that compiles, from its only slice."""
    rows = measurement["gpus"]
    mesa = ", ".join(dict.fromkeys(row["mesa"] for row in rows))
    shared = {name: measurement[name] for name in _SHARED}
    return {
        "scene": request.scene,
        "family": None,
        **shared,
        "device": {
            "id": COMPILERS,
            "kind": "compiler",
            "name": "Mesa's phone compilers, no GPU",
            "driver": f"Mesa {mesa}",
        },
        **request.variant.as_dict(),
        "size": list(request.size),
        "rays_kind": request.rays,
        "frames": 0,
        "overflows": 0,
        "model": {"compiled": model_of(rows)},
        "compiled": {"gpus": rows, "listing": measurement.get("listing")},
    }


_SHARED = (
    "triangles", "sah", "depth", "structure_bytes", "primitive_bytes", "build_ms", "specialised", "versions",
    "started_at",
)  # fmt: skip
