"""Why there is no estimate."""

from __future__ import annotations


class CompileError(ValueError):
    """A GPU, a tool chain or a listing that gives no estimate; the message is one sentence that says what to do."""
