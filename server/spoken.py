"""Errors whose message is a sentence for the user."""

from __future__ import annotations

PACKAGES = ("scenes", "renderer", "server")


def spoken(error: BaseException) -> str | None:
    """The sentence of one of the project's own errors; None for any other."""
    ours = isinstance(error, ValueError | RuntimeError) and type(error).__module__.split(".")[0] in PACKAGES
    return str(error) if ours and str(error) else None
