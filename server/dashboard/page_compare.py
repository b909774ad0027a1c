"""The comparison."""

from __future__ import annotations

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select

from server.api.state import database_of
from server.comparison.selection import known_values, load_comparison, read_selection
from server.dashboard.context import comparison_context
from server.dashboard.templates import render
from server.store.models import Study

router = APIRouter(include_in_schema=False)
SHOWN = 50


@router.get("/")
def compare_page(request: Request) -> Response:
    """The comparison; the query string is its whole state."""
    selection = read_selection(request.query_params)
    database = database_of(request)
    table = load_comparison(database, selection)
    with database.reading() as session:
        recent = select(Study.id, Study.name).order_by(Study.id.desc()).limit(SHOWN)
        studies = [(number, name) for number, name in session.execute(recent)]
    return render(request, "compare.html", comparison_context(table, selection, known_values(database), studies))
