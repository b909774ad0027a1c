"""Every claim judged on every section of results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from server.paper.claims import CLAIMS
from server.paper.data import Json, Section, sections
from server.paper.errors import PaperError
from server.paper.verdict import OUTCOMES, Verdict, verdict_view

Verdicts = list[Verdict]


def judge(documents: Iterable[Json]) -> Verdicts:
    """All claims on all sections, section by section; raise PaperError where no result is of the paper's variants."""
    return [verdict for section in require_sections(documents) for verdict in judge_section(section)]


def judge_section(section: Section) -> Verdicts:
    """All claims on one section, in the table's order."""
    return [Verdict(claim, section, claim.rule.judge(section)) for claim in CLAIMS]


def require_sections(documents: Iterable[Json]) -> list[Section]:
    """The results' sections; raise PaperError where there is none."""
    found = sections(documents)
    if not found:
        raise PaperError("There is no result of the paper's traversals yet: run the study `paper` first.")
    return found


def claims_view(verdicts: Verdicts) -> dict[str, Any]:
    """Verdicts as plain JSON, with how many there are of each outcome."""
    counts = {outcome: sum(verdict.outcome == outcome for verdict in verdicts) for outcome in OUTCOMES}
    return {"outcomes": counts, "claims": [verdict_view(verdict) for verdict in verdicts]}
