"""A study of hard cases as one HTML page that needs no network and no script."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from server.dashboard.templates import FOLDER, TEMPLATES
from server.hard_cases.matrix import axes_of, read_view
from server.hard_cases.shown import study_parts

STYLES = ("style.css", "hard_cases.css")
MOST_COLUMNS = 200


def render_report(document: dict[str, Any]) -> str:
    """The page: facts, promises, the whole table with the traversals merged, and what was refused."""
    view = read_view(axes_of(document["cells"]), ())
    style = "\n".join((FOLDER / "static" / name).read_text(encoding="utf-8") for name in STYLES)
    context = {"style": Markup(style), **study_parts(document, view, MOST_COLUMNS)}
    return TEMPLATES.env.get_template("hard_cases_report.html").render(context)


def write_report(document: dict[str, Any], path: Path) -> None:
    """Write the report of a study's document."""
    path.write_text(render_report(document), encoding="utf-8")
