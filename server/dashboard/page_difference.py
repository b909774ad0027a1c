"""Two sides held against each other, pair by pair."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from renderer.times.difference import DifferenceError
from server.api.difference import MAX_RESULTS, load, stored_side
from server.api.state import database_of
from server.comparison.derived import DerivedError
from server.comparison.differences import CLOCKS, DEFAULT_GATE, SETUP, Differences, Pair, find_differences
from server.comparison.figures import write_percent
from server.comparison.selection import known_values
from server.comparison.sides import SideError, compared_names
from server.comparison.stored_alarms import latest_alarms
from server.dashboard.templates import render
from server.problems import Problem
from server.store.models import Job, Study

router = APIRouter(include_in_schema=False)

OFFERED = 20
"""How many studies and jobs the form offers."""
LIKELY = ("device", "traversal", "method", "layout", "builder", "fetch", "sah", "specialise", "size")
"""What the form offers to choose sides by."""
SHOWN = 500
"""The most pairs on a page; the API gives all."""
NARROWEST = math.log(1.05)
"""The bars' scale reaches at least 5 % to either side."""


class PageError(ValueError):
    """An address that is not understood; the message is one sentence that says what to do."""


@dataclass(frozen=True)
class Asked:
    """The query string: both sides, the clock, and the slowdown in per cent that counts as one."""

    baseline: str
    against: str
    clock: str
    threshold: str


@dataclass(frozen=True)
class PairView:
    """One pair in words; `marks` are the interval's ends and the ratio on a line from 0 to 100, where 50 is 1."""

    name: str
    changes: list[str]
    ratio: str
    interval: str
    verdict: str
    visible: str
    size: str
    answers: str
    marks: tuple[float | None, float, float | None]
    notes: list[str]
    stopped: bool


@router.get("/difference")
def difference_page(request: Request) -> Response:
    """A form for two sides; with both of them their pairs. The query string is its whole state."""
    params = request.query_params
    asked = Asked(
        params.get("baseline", "").strip(),
        params.get("against", "").strip(),
        params.get("clock") or "auto",
        params.get("threshold") or f"{DEFAULT_GATE * 100:g}",
    )
    database = database_of(request)
    context: dict[str, Any] = {"asked": asked, "clocks": CLOCKS, "problem": "", "found": None}
    status, devices = 200, None
    if asked.baseline or asked.against:
        try:
            found, full = _find(request, asked)
            context |= {"found": _view(found, _margin(asked), full)}
            devices = {place["device"] for place in _places(found)}
        except (SideError, DerivedError, DifferenceError, PageError) as error:
            context["problem"], status = str(error), 422
        except Problem as error:
            context["problem"], status = str(error.detail), error.status_code
    with database.reading() as session:
        context["offers"] = _offers(session, known_values(database))
        context["alarms"] = [(number, alarms, write_percent) for number, alarms in latest_alarms(session, devices)]
    answer = render(request, "difference.html", context)
    answer.status_code = status
    return answer


def _find(request: Request, asked: Asked) -> tuple[Differences, bool]:
    """The pairs, and whether a side may hold more results than were looked at."""
    if not (asked.baseline and asked.against):
        raise PageError("One side is empty: name both, as job:1 and job:2.")
    if asked.clock not in CLOCKS:
        raise PageError(f"Unknown clock {asked.clock!r}: choose one of {', '.join(CLOCKS)}.")
    _margin(asked)
    first, second = stored_side(asked.baseline), stored_side(asked.against)
    database = database_of(request)
    sides = load(database, first), load(database, second)
    found = find_differences(*sides, compared_names(first, second), asked.clock)
    return found, any(len(side) >= MAX_RESULTS for side in sides)


def _margin(asked: Asked) -> float:
    try:
        threshold = float(asked.threshold)
    except ValueError:
        threshold = math.nan
    if not 0 <= threshold <= 1000:
        raise PageError(f"The threshold is {asked.threshold!r}: give a percentage from 0 to 1000.")
    return threshold / 100


def _view(found: Differences, margin: float, full: bool) -> dict[str, Any]:
    places = [pair.place for pair in found.pairs]
    shared = {name: value for name, value in (places[0] if places else {}).items() if _alike(places, name)}
    changes = [pair.compared for pair in found.pairs]
    everywhere = {name: ends for name, ends in (changes[0] if changes else {}).items() if _alike(changes, name)}
    around = [pair.environment for pair in found.pairs]
    environment = {name: ends for name, ends in (around[0] if around else {}).items() if _alike(around, name)}
    order = sorted(found.pairs, key=lambda pair: -pair.difference.ratio)
    reach = max([NARROWEST, *(abs(math.log(end)) for pair in order for end in _ends(pair) if end)])
    verdicts = [pair.difference.verdict for pair in order]
    notes = [f"Only the latest {MAX_RESULTS} results of a side were looked at: choose fewer."] if full else []
    if len(order) > SHOWN:
        notes.append(f"There are {len(order)} pairs; the {SHOWN} with the largest ratio are shown, the JSON has all.")
    if any(pair.apart for pair in order):
        notes.append("The two were measured one after the other: what changed on the machine meanwhile counts, too.")
    return {
        "pairs": [_pair(pair, {*shared, *everywhere, *environment}, margin, reach) for pair in order[:SHOWN]],
        "shared": [f"{name} {value}" for name, value in shared.items()],
        "everywhere": [f"{name} {first} → {second}" for name, (first, second) in everywhere.items()],
        "environment": [f"{name} {first} → {second}" for name, (first, second) in environment.items()],
        "counts": [(verdict, verdicts.count(verdict)) for verdict in dict.fromkeys(sorted(verdicts))],
        "stopped": len(found.slower(margin)),
        "margin": write_percent(margin),
        "scale": f"{math.exp(-reach):.2f} to {math.exp(reach):.2f}",
        "alone": [("baseline", _names(found.only_baseline)), ("against", _names(found.only_against))],
        "notes": notes,
    }


def _pair(pair: Pair, told: set[str], margin: float, reach: float) -> PairView:
    """One pair, without the names of what all pairs have alike, which is told above them."""
    found = pair.difference
    low, ratio, high = (None if end is None else 50 + 48 * math.log(end) / reach for end in _ends(pair))
    assert ratio is not None
    return PairView(
        name=", ".join(value for name, value in pair.place.items() if name not in told) or pair.place["scene"],
        changes=[f"{name} {a} → {b}" for name, (a, b) in pair.compared.items() if name not in told],
        ratio=f"{found.ratio:.3f}",
        interval="" if found.low is None or found.high is None else f"{found.low:.3f}–{found.high:.3f}",
        verdict=found.verdict,
        visible="" if found.visible is None else write_percent(found.visible),
        size="not known" if pair.beside.size is None else f"{pair.beside.size:.3f}",
        answers=pair.beside.hits or "not known",
        marks=(low, ratio, high),
        notes=_pair_notes(pair, told),
        stopped=found.is_slower_by(margin),
    )


def _pair_notes(pair: Pair, told: set[str]) -> list[str]:
    environment = pair.environment.items()
    notes = [f"{name} {first} → {second}" for name, (first, second) in environment if name not in told]
    notes += pair.beside.notes
    if pair.difference.low is None:
        notes.append("no interval: it takes at least 4 rounds a side")
    if pair.repeated:
        notes.append(f"{pair.repeated} older result{'s' if pair.repeated > 1 else ''} left out")
    rounds = pair.difference.rounds
    return [*notes, f"{rounds[0]} and {rounds[1]} rounds, {'processor' if pair.clock == 'cpu' else 'wall'} time"]


def _ends(pair: Pair) -> tuple[float | None, float, float | None]:
    return pair.difference.low, pair.difference.ratio, pair.difference.high


def _alike(items: Sequence[dict[str, Any]], name: str) -> bool:
    return len({item.get(name) for item in items}) == 1


def _places(found: Differences) -> list[dict[str, str]]:
    pairs = [pair.place | {"device": device} for pair in found.pairs for device in _devices(pair)]
    return [*pairs, *found.only_baseline, *found.only_against]


def _devices(pair: Pair) -> tuple[str, ...]:
    return pair.environment.get("device", (pair.place.get("device", ""),))


def _names(places: Sequence[dict[str, str]]) -> list[str]:
    """Places of results without partner, without what all of them share."""
    differing = [name for name in SETUP if not _alike(places, name)] or ["scene", "traversal", "method", "layout"]
    return list(dict.fromkeys(", ".join(place[name] for name in differing) for place in places))[:SHOWN]


def _offers(session: Session, known: dict[str, list[str]]) -> list[tuple[str, str]]:
    """What the form offers for a side, each with a word about it."""
    studies = session.execute(select(Study.id, Study.name).order_by(Study.id.desc()).limit(OFFERED)).all()
    done = select(Job.id, Job.scene, Job.label, Job.device).where(Job.state == "done")
    jobs = session.execute(done.order_by(Job.id.desc()).limit(OFFERED)).all()
    axes = [f"{name}={value}" for name in LIKELY if len(known[name]) > 1 for value in known[name]]
    return [
        *((f"study:{number}", name) for number, name in studies),
        *((text, "all results") for text in axes),
        *((f"job:{number}", f"{label} on {scene}, {device}") for number, scene, label, device in jobs),
    ]
