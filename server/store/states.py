"""The states of a job and of a slice.

A job's state is that of the slice in hand: `waiting` for a device that is not there, `preparing` (scene, structure,
plan, push), `running` (on the device), `judging` (its errors); between two slices it stays what it was.
"""

from __future__ import annotations

from typing import Literal, get_args

State = Literal["queued", "waiting", "preparing", "running", "judging", "done", "failed", "cancelled"]

STATES: tuple[State, ...] = get_args(State)
OPEN: tuple[State, ...] = ("queued", "waiting", "preparing", "running", "judging")
"""The states in which work is still to come."""
HELD: tuple[State, ...] = ("preparing", "running", "judging")
"""The states of a slice that a worker holds."""
