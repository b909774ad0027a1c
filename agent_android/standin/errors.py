"""What goes wrong with a stand-in phone."""

from __future__ import annotations


class StandInError(Exception):
    """A stand-in phone did not do what was asked; the message says what to do."""


class StandInUnavailableError(StandInError):
    """No stand-in phone can be had on this machine; the message says what is missing."""
