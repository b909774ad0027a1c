"""What is said about a claim, and its JSON form."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from server.paper.claims import Claim
    from server.paper.data import Section

Outcome = Literal["holds", "does not hold", "undecided"]
OUTCOMES: tuple[Outcome, ...] = ("holds", "does not hold", "undecided")
Basis = Literal["measured", "counted", "model", "imported"]


@dataclass(frozen=True)
class Part:
    """One cell, scene or rival behind a verdict; `outcome` is its own."""

    name: str
    value: float | None
    low: float | None = None
    high: float | None = None
    outcome: Outcome | None = None
    note: str = ""


@dataclass(frozen=True)
class Finding:
    """An outcome with its figures.

    `what` says what `value` is; `spread` says what `low` and `high` bound: a 95 % interval, or the least and the most
    over scenes. `missing` lists what was not measured.
    """

    outcome: Outcome
    reason: str
    what: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    spread: str = "95 % interval"
    basis: Basis = "measured"
    parts: tuple[Part, ...] = ()
    missing: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Verdict:
    """One claim of the paper, judged on one section of the results."""

    claim: Claim
    section: Section
    finding: Finding

    @property
    def outcome(self) -> Outcome:
        """Holds, does not hold, or undecided."""
        return self.finding.outcome


def undecided(reason: str, missing: tuple[str, ...] = ()) -> Finding:
    """A finding without figures."""
    return Finding("undecided", reason, missing=missing)


def verdict_view(verdict: Verdict) -> dict[str, Any]:
    """A verdict as plain JSON."""
    claim = verdict.claim
    return {
        "id": claim.key,
        "claim": claim.text,
        "paper": {"section": claim.where, "figure": claim.figure, "said": claim.said},
        "device": verdict.section.place,
        "clock": verdict.section.clock,
        **asdict(verdict.finding),
    }
