"""A job's life out of its changes of state: the phases that it went through, and the runs of its slices."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

from server.store.models import Change, Job
from server.store.states import OPEN, State

_ROUND = re.compile(r"Round (\d{1,5}) of \d.*?(?:, attempt (\d{1,4}))?\.", re.DOTALL)
"""What `server.queue.ledger` gives as the reason of a change that a worker's slice makes."""


@dataclass(frozen=True)
class Phase:
    """The time from one change of a job to the next; `round` counts from 1, None for what no slice did."""

    state: State
    reason: str | None
    start: datetime
    end: datetime
    round: int | None
    attempt: int | None


@dataclass(frozen=True)
class Run:
    """One attempt at a slice; `worker` is who holds it or measured it, None where it was let go of."""

    round: int
    attempt: int
    start: datetime
    end: datetime
    worker: str | None


def read_phases(changes: Sequence[Change], now: datetime) -> tuple[list[Phase], Change | None]:
    """A job's phases in order, the last of an open job until `now`; and the change that ended it, if one did.

    Clocks of several hosts may disagree: no phase begins before the one in front of it.
    """
    phases: list[Phase] = []
    for change, following in zip(changes, [*changes[1:], None], strict=True):
        if change.state not in OPEN:
            return phases, change
        start = max(change.at, phases[-1].end) if phases else change.at
        end = max(start, following.at if following else now)
        said = _ROUND.fullmatch(change.reason or "")
        round_, attempt = (int(said[1]), int(said[2] or 1)) if said else (None, None)
        phases.append(Phase(change.state, change.reason, start, end, round_, attempt))
    return phases, None


def read_runs(job: Job, phases: Sequence[Phase]) -> Iterator[Run]:
    """The runs of a job's slices, each from its claim to the last phase that tells of it.

    A slice's own end, which is that of its last attempt, is more exact than the job's next change.
    """
    spans: dict[tuple[int, int], tuple[datetime, datetime]] = {}
    for phase in phases:
        if phase.round is not None and phase.attempt is not None:
            key = (phase.round, phase.attempt)
            spans[key] = (spans[key][0] if key in spans else phase.start, phase.end)
    slices = {part.round + 1: part for part in job.slices}
    for (round_, attempt), (start, end) in spans.items():
        part = slices.get(round_)
        part = part if part is not None and part.attempts == attempt else None
        ended = part.ended_at if part is not None else None
        end = ended if ended is not None and start <= ended <= end else end
        yield Run(round_, attempt, start, end, part.worker if part else None)


def running_starts(phases: Sequence[Phase]) -> dict[int, datetime]:
    """When each round was last put on its device."""
    return {phase.round: phase.start for phase in phases if phase.round is not None and phase.state == "running"}
