"""The counts of the paper's heatmap (section 4.1): what every pixel's rays fetched, from an instrumented run.

A node counts as traversed when it is fetched from the structure's SSBO. The run has a process of its own
(`python -m renderer.pictures.heatmap`), as a slice has.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from renderer.answering import Json, Say, answer_task, silent, tell_note
from renderer.child import run_child
from renderer.instrumented import records_of
from renderer.locks import holding, machine_lock
from renderer.pictures.counts import METRICS, Counts, count_pixels
from renderer.planner import in_passes
from renderer.prepare import Prepared, prepare
from renderer.request import Request, RequestError
from renderer.twin_host import TwinHost


def require_metric(name: str) -> str:
    """Return the name of a metric; raise RequestError naming those that exist."""
    if name not in METRICS:
        raise RequestError(f"Unknown metric {name!r}: choose one of {', '.join(METRICS)}.")
    return name


def heatmap(request: Request, metric: str = "nodes", timeout_s: float = 900.0, note: Say = silent) -> Counts:
    """Count a metric per pixel, (h, w) int64, row 0 at the bottom.

    `request.rays` says whose fetches: of the primary ray, of the shadow rays, or of both together. Raise
    RequestError for an unknown metric and ChildError when the run fails or outlasts `timeout_s` seconds.
    """
    require_metric(metric)
    with tempfile.TemporaryDirectory(prefix="rayfarm-heatmap-") as folder:
        path = Path(folder) / "counts.npy"
        task = {"request": request.to_json(), "metric": metric, "counts": str(path)}
        run_child("renderer.pictures.heatmap", task, request.threads, timeout_s, note=note)
        counts: Counts = np.load(path)
        return counts


@dataclass(frozen=True)
class Summary:
    """The figures of one heatmap, per pixel."""

    mean: float
    p50: float
    p99: float
    max: int

    @property
    def text(self) -> str:
        """The figures in one line."""
        return f"mean {self.mean:,.1f}, median {self.p50:,.0f}, p99 {self.p99:,.0f}, max {self.max:,}"


def summarise(counts: Counts) -> Summary:
    """Mean, median, 99th percentile and maximum over all pixels."""
    p50, p99 = np.percentile(counts, [50, 99])
    return Summary(float(counts.mean()), float(p50), float(p99), int(counts.max()))


def _refuse_uncounted(prepared: Prepared) -> None:
    if in_passes(prepared.scene, prepared.tree):
        raise RequestError(
            f"brute-force on {len(prepared.scene.faces):,} triangles runs in passes, which carry no counters: draw a "
            "traversal of a structure, or a smaller scene."
        )


def _work(task: Json, say: Say) -> Json:
    request = Request.from_json(task["request"])
    with holding(machine_lock(), lambda: say("waiting")):
        say("running")
        prepared = prepare(request, note=tell_note)
        _refuse_uncounted(prepared)
        plan = prepared.plan(instrument=True)
        records = records_of(prepared, plan, TwinHost(request.threads).collect(plan))
    counts = count_pixels(records, request.rays, task["metric"])
    np.save(task["counts"], counts)
    return {"saved": task["counts"]}


if __name__ == "__main__":
    answer_task(_work)
