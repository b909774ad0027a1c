"""Why there is no figure."""

from __future__ import annotations


class ModelError(ValueError):
    """The model cannot say; the message is one sentence with the reason."""
