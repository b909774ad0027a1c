"""What every pixel's rays fetched, from an instrumented run's records (the paper's heatmaps, section 4.1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.records import COUNTERS, Records

Counts = npt.NDArray[np.int64]

METRICS = {"nodes": "nodes fetched", "triangles": "triangles tested", "bytes": "bytes fetched"}
"""What is counted of a pixel, and how it is called."""


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
