"""GET /api/v1/predictors: how well costs and work foretell speed, device by device."""

from __future__ import annotations

from dataclasses import asdict
from itertools import islice
from typing import Any

from fastapi import APIRouter, Request

from server.api.state import database_of
from server.comparison.predictors import OnDevice, predictors
from server.comparison.selection import Selection, load_rows, read_selection
from server.store.database import Database

router = APIRouter(prefix="/api/v1")

MOST_RESULTS = 5000
"""The newest results that are looked at."""


@router.get("/predictors")
def read_predictors(request: Request) -> dict[str, Any]:
    """SAH cost, end-point overlap and the work of rays against the time of a ray; filtered as a comparison is."""
    found = load_predictors(database_of(request), read_selection(request.query_params))
    return {"devices": [asdict(one) for one in found]}


def load_predictors(database: Database, selection: Selection) -> list[OnDevice]:
    """Those of the newest selected results."""
    return predictors(islice(iter(load_rows(database, selection)), MOST_RESULTS))
