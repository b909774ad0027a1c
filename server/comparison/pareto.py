"""The Pareto front: the variants that no other beats in speed without costing more."""

from __future__ import annotations

from collections.abc import Sequence

from server.comparison.metrics import METRICS
from server.comparison.pivot import Cell, Comparison

COSTS = {
    "error": "error_total",
    "edge": "error_edge",
    "shadow": "error_shadow_mismatch",
    "ulp": "error_t_ulp_max",
    "flip": "error_flip",
    "psnr": "error_psnr",
    "size": "structure_bytes",
}
"""What speed is held against, and its metric; one of which more is better is paid for by having less."""
SPEED = "mrays_per_s"
RAYS = ("scene", "size", "rays_kind")
"""What results must share for their speeds to be of the same rays; fields of a flat row."""


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """The places of the points (cost, speed) that no other dominates, by rising cost and then speed.

    A point is dominated by one that is not worse in either and better in one: lower cost, higher speed. Equal points
    are on the front together.
    """
    found: list[int] = []
    best = (float("inf"), float("-inf"))
    for place in sorted(range(len(points)), key=lambda i: (points[i][0], -points[i][1])):
        cost, speed = points[place]
        if speed > best[1] or (cost, speed) == best:
            found.append(place)
            best = cost, speed
    return found


def fronts(table: Comparison, cost: str) -> list[list[int] | None]:
    """Each column's front of speed against one of COSTS, as places of rows; by the values alone, not their intervals.

    None where a column mixes scenes, sizes or rays: there no variant stands against another.
    """
    return [_of_column([line[j] for line in table.cells], COSTS[cost]) for j in range(len(table.column_keys))]


def _of_column(column: Sequence[Cell | None], cost: str) -> list[int] | None:
    sign = -1.0 if METRICS[cost].better == "higher" else 1.0
    points: dict[int, tuple[float, float]] = {}
    rays = set()
    for place, cell in enumerate(column):
        if cell is None:
            continue
        paid, speed = cell.figures[cost].value, cell.figures[SPEED].value
        if paid is not None and speed is not None:
            points[place] = sign * paid, speed
            rays.add(tuple(str(cell.row.get(name)) for name in RAYS))
    if len(rays) > 1:
        return None
    places = list(points)
    return [places[i] for i in front(list(points.values()))]
