"""What is wrong with a profiler's file."""

from __future__ import annotations


class ProfileError(ValueError):
    """A file that cannot be imported; the message is one sentence that says what to do."""
