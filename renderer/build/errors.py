"""Why a structure cannot be built."""

from __future__ import annotations


class BuildError(ValueError):
    """A structure that cannot be built; the message is one sentence that says what to do."""
