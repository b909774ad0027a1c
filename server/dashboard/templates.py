"""Jinja2, with every value escaped and every missing one an error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from fastapi.templating import Jinja2Templates
from jinja2 import Environment, FileSystemLoader, StrictUndefined

FOLDER = Path(__file__).parent

TEMPLATES = Jinja2Templates(
    env=Environment(
        loader=FileSystemLoader(FOLDER / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
)


def render(request: Request, name: str, context: dict[str, Any]) -> Response:
    """A page; its address tells the template which of the pages' links is the current one."""
    return TEMPLATES.TemplateResponse(request, name, {**context, "path": request.url.path})
