"""What foretells speed: a tree's costs and a ray's work against the time of a ray, on each device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fastapi import APIRouter, Request
from fastapi.responses import Response

from server.api.predictors import MOST_RESULTS, load_predictors
from server.api.state import database_of
from server.comparison.predictors import Predicted
from server.comparison.selection import read_selection
from server.dashboard.templates import render

router = APIRouter(include_in_schema=False)

SIDE = 200
"""The side of a picture of points."""
INSET = 12
DRAWN = 400
"""The most points that a picture has."""


@dataclass(frozen=True)
class Plot:
    """A square picture: points by place, the ends of the fitted line, and the factor that either axis spans."""

    points: list[tuple[float, float]]
    line: tuple[float, float, float, float]
    across: str
    up: str


@router.get("/predictors")
def predictors_page(request: Request) -> Response:
    """All devices, filtered by the query string as the comparison is."""
    selection = read_selection(request.query_params)
    devices = [
        (one.device, one.rays, [(each, _plot(each)) for each in one.predictors])
        for one in load_predictors(database_of(request), selection)
    ]
    filtered = sorted((name, ", ".join(values)) for name, values in selection.filters.items())
    context = {"devices": devices, "filtered": filtered, "most": MOST_RESULTS, "side": SIDE}
    return render(request, "predictors.html", context)


def _plot(found: Predicted) -> Plot:
    """Logarithmic axes around 1 in the middle, each as wide as its points are."""
    x, y = ([math.log(point[axis]) for point in found.points] for axis in (0, 1))
    wide, high = _reach(x), _reach(y)
    step = -(-len(x) // DRAWN)
    points = [(_place(a, wide), _place(-b, high)) for a, b in zip(x[::step], y[::step], strict=True)]
    end = min(wide, high / abs(found.exponent)) if found.exponent else wide
    rise = found.exponent * end
    line = (_place(-end, wide), _place(rise, high), _place(end, wide), _place(-rise, high))
    return Plot(points, line, f"{math.exp(2 * wide):.3g}", f"{math.exp(2 * high):.3g}")


def _reach(values: Sequence[float]) -> float:
    return max(max(abs(value) for value in values), 1e-6)


def _place(value: float, reach: float) -> float:
    return round(SIDE / 2 + value / reach * (SIDE / 2 - INSET), 2)
