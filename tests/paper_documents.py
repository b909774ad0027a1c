"""Made-up results of the study `paper` in which everything is planted: times, counts, models."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from renderer.pictures.files import write_pictures
from server.paper.data import COSTS, TRAVERSALS, Cell

Json = dict[str, Any]
Factor = Callable[[Cell], float]

SCENES = {"cornell-box": 36, "cornell-statue": 100_008, "forest": 174_000}
PAIRS = ((1.5, 3.0), (2.0, 1.5), COSTS, (6.0, 1.5))
"""SAH costs by their ratio of traversal to intersection: 0.5, 1.33, 2 and 4."""


def cells(scenes: Mapping[str, int] = SCENES) -> list[Cell]:
    """Everything that the study measures."""
    found = []
    for scene in scenes:
        for traversal in TRAVERSALS:
            found += [Cell(scene, traversal, method) for method in ("fragment", "compute", "hybrid")]
            found += [Cell(scene, traversal, layout=layout) for layout in ("normal", "compact", "split")]
            found += [Cell(scene, traversal, sah=pair) for pair in PAIRS]
    return list(dict.fromkeys(found))


def _one(_: Cell) -> float:
    return 1.0


@dataclass(frozen=True)
class World:
    """What is true in a set of made-up results: factors on a basic figure, by cell. `noise` is a deviation of logs.

    A cell that `swings` takes four times as long in every other round.
    """

    time: Factor = _one
    nodes: Factor = _one
    bytes: Factor = _one
    lines: Factor = _one
    triangles: Factor = _one
    alu: Factor = _one
    depth: Factor = _one
    primitive_bytes: Factor = _one
    rounds: int = 6
    noise: float = 0.004
    seed: int = 1
    swings: Callable[[Cell], bool] = lambda _: False
    scenes: Mapping[str, int] = field(default_factory=lambda: SCENES)
    clock: str = "cpu"
    change: Callable[[Cell, Json], Json | None] = lambda _, document: document

    def documents(self) -> list[Json]:
        """One result a cell; `change` may alter it or leave it out."""
        made = ((cell, self._document(cell)) for cell in cells(self.scenes))
        changed = (self.change(cell, document) for cell, document in made)
        return [document for document in changed if document is not None]

    def _document(self, cell: Cell) -> Json:
        chance = random.Random(f"{self.seed} {cell.text}")
        frames = [20.0 * self.time(cell) * math.exp(chance.gauss(0, self.noise)) for _ in range(2 * self.rounds)]
        if self.swings(cell):
            frames = [time * (4 if i % 4 < 2 else 1) for i, time in enumerate(frames)]
        return {
            "scene": cell.scene,
            "family": None,
            "triangles": self.scenes[cell.scene],
            "device": {
                "id": "llvmpipe@here", "kind": "twin", "name": "llvmpipe", "driver": "Mesa 22.3.6",
                "threads": 1 if self.clock == "cpu" else 4, "cores": 2, "machine": "x86_64",
            },
            "traversal": cell.traversal, "method": cell.method, "layout": cell.layout,
            "intersector": "moller-trumbore", "box": "williams", "nodes": "f32", "precision": "highp",
            "offset": "constant", "builder": "sah",
            "sah": {"traversal": cell.sah[0], "intersection": cell.sah[1], "cost": 30.0, "epo": 4.0},
            "depth": round(20 * self.depth(cell)),
            "size": [64, 64],
            "rays_kind": "both",
            "frames": len(frames),
            "frames_by_round": [2] * self.rounds,
            "frames_ms": frames,
            "frames_cpu_ms": frames,
            "rays": {"primary": 0 if cell.method == "hybrid" else 4096, "shadow": 4000},
            "structure_bytes": 65_536,
            "primitive_bytes": round(10**6 * self.primitive_bytes(cell)),
            "per_ray": {
                "nodes": 40.0 * self.nodes(cell), "inner": 30.0, "leaves": 10.0,
                "triangles": 8.0 * self.triangles(cell), "bytes": 2000.0 * self.bytes(cell),
                "lines": 30.0 * self.lines(cell),
            },
            "error": {
                "false_hit": 0.0, "false_miss": 2e-5, "edge": 1e-4, "wrong_primitive": 0.0, "shadow_mismatch": 1e-5,
                "raster_mismatch": 1e-4 if cell.method == "hybrid" else None,
            },
            "model": {
                "lines": {
                    "line_bytes": 64, "cache_lines": 256, "block": [8, 8], "rays": 4096,
                    "text": "Made-up lines.",
                },
                "alu_per_fragment": 5000.0 * self.alu(cell), "alu_per_ray": 2500.0 * self.alu(cell),
                "alu_text": "A model, not a measurement: made-up instructions.",
            },
            "pictures": None,
            "specialised": None,
            "load_average": 1.5,
            "versions": {"rayfarm": "0.1.0", "shader_sha": "ab" * 8, "plan": 1},
            "started_at": "2026-01-01T00:00:00+00:00",
        }  # fmt: skip


def with_pictures(folder: Path) -> Callable[[Cell, Json], Json]:
    """A change of results that gives each an image and, with fragment and normal, counts, as files in `folder`."""

    def change(cell: Cell, document: Json) -> Json:
        rows, columns = np.mgrid[0:48, 0:64]
        waves = 2 + np.sin(rows / 6) * np.cos(columns / 9)
        nodes = (20 * (1 + TRAVERSALS.index(cell.traversal)) * waves).astype(np.int64)
        image = np.repeat((columns * 3).astype(np.uint8)[..., None], 3, axis=2)
        counted = (cell.method, cell.layout, cell.sah) == ("fragment", "normal", COSTS)
        counts = {"nodes": nodes, "triangles": nodes // 3, "bytes": nodes * 32} if counted else None
        return document | {"pictures": dict(write_pictures(folder, image, counts))}

    return change
