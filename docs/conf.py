"""The documentation as a site: `make docs`. The sources are the Markdown files of the repository, where they lie."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))

project = "RayFarm"
project_copyright = "The RayFarm developers"
extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = ["docs/**", "*.md", "agent_android/**"]
exclude_patterns = ["README.md", ".*", "var", "tests", "**/build", "**/images"]

html_theme = "furo"
html_title = "RayFarm"
html_copy_source = False

highlight_language = "none"
myst_heading_anchors = 3

OPERATIONS = "<!-- operations -->"


def setup(app: Sphinx) -> None:
    """Put the API's operations into their page, from the application's own OpenAPI document."""
    app.connect("source-read", _completed)


def _completed(app: Sphinx, name: str, source: list[str]) -> None:
    if name == "docs/api":
        logging.getLogger("alembic").setLevel(logging.WARNING)
        from api_page import operations

        source[0] = source[0].replace(OPERATIONS, operations())
