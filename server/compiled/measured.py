"""What a phone with a GPU measured of the very variant that was compiled for it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.variant import AXES
from server.store.models import Result

Json = dict[str, Any]
LATEST = 50
"""How many of a variant's results are looked at, the newest first."""
SAME = ("size", "rays_kind")


def measured_on(session: Session, document: Json) -> dict[str, Json]:
    """For each GPU of a compiled result the newest result of the same scene, variant, size and rays on a phone with it.

    `job`, `frame_ms`, `alu_per_fragment` of an imported profile, and `ratio`, that figure by the estimate's.
    """
    rows = (document.get("compiled") or {}).get("gpus") or []
    same = [getattr(Result, axis) == str(document.get(axis)) for axis in AXES]
    query = select(Result).where(Result.scene == str(document.get("scene")), *same).order_by(Result.id.desc())
    others = [(result.job_id, result.document) for result in session.scalars(query.limit(LATEST))]
    found = {row["gpu"]: _newest(row, document, others) for row in rows}
    return {gpu: measured for gpu, measured in found.items() if measured is not None}


def _newest(row: Json, document: Json, others: Iterable[tuple[int, Json]]) -> Json | None:
    for job, other in others:
        if all(other.get(name) == document.get(name) for name in SAME) and is_gpu(
            other.get("device") or {}, row["gpu"]
        ):
            alu = (other.get("profile") or {}).get("alu_per_fragment")
            estimate = row.get("alu_per_fragment")
            return {
                "job": job,
                "frame_ms": (other.get("frame_ms") or {}).get("median"),
                "alu_per_fragment": alu,
                "ratio": alu / estimate if alu is not None and estimate else None,
            }
    return None


def is_gpu(device: Mapping[str, Any], gpu: str) -> bool:
    """Whether a device's own words (`Adreno (TM) 540`, `Mali-G72 MC1`) name a GPU of ours (`adreno-540`)."""
    if device.get("kind") == "compiler":
        return False
    maker, model = gpu.split("-")
    words = re.findall(r"[a-z0-9]+", f"{device.get('renderer') or ''} {device.get('name') or ''}".lower())
    return maker in words and model in words
