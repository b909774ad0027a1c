"""The counts of the paper's heatmap (section 4.1): what every pixel's rays fetched, from an instrumented run.

A node counts as traversed when it is fetched from the structure's SSBO. The run has a process of its own
(`python -m renderer.heatmap`), as a slice has.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.host import end_with_parent, measuring
from renderer.instrumented import instrumented
from renderer.planner import in_passes
from renderer.prepare import Prepared, prepare
from renderer.records import COUNTERS, Records
from renderer.request import Request, RequestError
from renderer.slice import SPOKEN
from renderer.twin import open_context

Counts = npt.NDArray[np.int64]

METRICS = {"nodes": "nodes fetched", "triangles": "triangles tested", "bytes": "bytes fetched"}
"""What can be drawn, and how it is called."""

SPOKEN_CODE = 3
"""The child's exit code when the last line of its standard error is a sentence for the user."""


class HeatmapError(RuntimeError):
    """A run that gave no counts; the message is one sentence."""


def require_metric(name: str) -> str:
    """Return the name of a metric; raise RequestError naming those that exist."""
    if name not in METRICS:
        raise RequestError(f"Unknown metric {name!r}: choose one of {', '.join(METRICS)}.")
    return name


def heatmap(request: Request, metric: str = "nodes", timeout_s: float = 900.0) -> Counts:
    """Count a metric per pixel, (h, w) int64, row 0 at the bottom.

    `request.rays` says whose fetches: of the primary ray, of the shadow rays, or of both together. Raise
    RequestError for an unknown metric and HeatmapError when the run fails or outlasts `timeout_s` seconds.
    """
    require_metric(metric)
    with tempfile.TemporaryDirectory(prefix="rayfarm-heatmap-") as folder:
        path = Path(folder) / "counts.npy"
        task = {"request": request.to_json(), "metric": metric, "counts": str(path), "parent": os.getpid()}
        try:
            done = subprocess.run(
                [sys.executable, "-m", "renderer.heatmap"],
                input=json.dumps(task),
                capture_output=True,
                text=True,
                timeout=timeout_s,
                env=os.environ | {"LP_NUM_THREADS": str(request.threads)},
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise HeatmapError(f"The heatmap was ended after {timeout_s:.0f} s, its time limit.") from error
        if done.returncode != 0:
            raise HeatmapError(_reason(done))
        counts: Counts = np.load(path)
        return counts


def count_pixels(records: Records, rays: str, metric: str) -> Counts:
    """Sum a counter of every pixel's rays, (h, w) int64, row 0 at the bottom."""
    width, height = records.size
    name, factor = ("words", 4) if metric == "bytes" else (metric, 1)
    column = COUNTERS.index(name)
    counts = np.zeros(width * height, np.int64)
    if rays != "shadow":
        counts += records.primary_counts[:, column]
    if rays != "primary":
        np.add.at(counts, records.shadow_pixel, records.shadow_counts[:, column].astype(np.int64))
    return counts.reshape(height, width) * factor


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
    triangles = len(prepared.scene.faces)
    if in_passes(prepared.scene, prepared.tree):
        raise RequestError(
            f"brute-force on {triangles:,} triangles runs in passes, which carry no counters: draw a "
            "traversal of a structure, or a smaller scene."
        )


def _reason(done: subprocess.CompletedProcess[str]) -> str:
    last = (done.stderr.strip().splitlines() or ["nothing on standard error"])[-1]
    return last if done.returncode == SPOKEN_CODE else f"The heatmap ended with code {done.returncode}: {last}"


def main() -> None:
    """Read one task from standard input, count, and save the counts where the task says."""
    task = json.load(sys.stdin)
    end_with_parent(task["parent"])
    try:
        request = Request.from_json(task["request"])
        with measuring():
            prepared = prepare(request)
            _refuse_uncounted(prepared)
            records = instrumented(prepared, open_context())
    except SPOKEN as error:
        print(error, file=sys.stderr)
        sys.exit(SPOKEN_CODE)
    np.save(task["counts"], count_pixels(records, request.rays, task["metric"]))


if __name__ == "__main__":
    main()
