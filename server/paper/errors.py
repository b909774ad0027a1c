"""What goes wrong with a report."""

from __future__ import annotations


class PaperError(ValueError):
    """Results from which no report can be made; the message is one sentence that says what to do."""
