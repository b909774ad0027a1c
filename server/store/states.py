"""The states of a job and of a slice."""

from __future__ import annotations

from typing import Literal, get_args

State = Literal["queued", "running", "done", "failed", "cancelled"]

STATES: tuple[State, ...] = get_args(State)
OPEN: tuple[State, ...] = ("queued", "running")
"""The states in which work is still to come."""
