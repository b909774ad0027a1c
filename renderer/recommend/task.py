"""A recommendation as a task, in a process of its own (`python -m renderer.recommend.task`).

The task is what `renderer.recommend.query.Query` writes; `renderer.child` says how it goes in and the answer comes out.
"""

from __future__ import annotations

from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from renderer.answering import Say, answer_task, tell_note
from renderer.host import Host
from renderer.kept_twins import KeptTwins
from renderer.recommend.halving import Eliminated, Finalist, Judged, Verdict, recommend
from renderer.recommend.pilot import Pilot, figures_of
from renderer.recommend.query import Query
from renderer.recommend.words import write_verdict
from renderer.variant import Variant

Json = dict[str, Any]


def answer(query: Query, host: Host, say: Say) -> Json:
    """Find what is asked for on a host; the document is that of docs/recommend.md."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    say("preparing")
    pilot = Pilot(query.requests, host)
    candidates = pilot.candidates(tell_note)
    say("running")
    found = recommend(candidates, pilot.measure, pilot.judge, query.terms, tell_note)
    return _document(query, pilot, found) | {"started_at": started, "versions": {"rayfarm": version("rayfarm")}}


def _document(query: Query, pilot: Pilot, found: Verdict) -> Json:
    base, variants = pilot.base, {label: request.variant for label, request in pilot.requests.items()}
    finalists = [_finalist(one, found, pilot, variants[one.label]) for one in found.finalists]
    unable = pilot.failed | found.failed
    return {
        "scene": base.scene,
        "triangles": len(pilot.scene.faces),
        "device": pilot.device,
        "size": list(base.size),
        "rays_kind": base.rays,
        "sah": {"traversal": base.costs.traversal, "intersection": base.costs.intersection},
        "error_budget": query.terms.error,
        "memory_budget": query.terms.memory,
        "seed": query.terms.seed,
        "clock": pilot.clock,
        "verdict": write_verdict(found, query.terms),
        "pick": finalists[0] if finalists else None,
        "fastest": found.fastest,
        "confidence": found.confidence,
        "rounds": query.terms.rounds,
        "finalists": finalists,
        "unconfirmed": [_eliminated(one, variants) for one in found.unconfirmed],
        "eliminated": [_eliminated(one, variants) for one in found.eliminated],
        "over_error": [_judged(label, one, variants) for label, one in found.over_error.items()],
        "over_memory": [{**_names(variants[label]), "memory_bytes": n} for label, n in found.over_memory.items()],
        "unable": [{**_names(variants[label]), "reason": reason} for label, reason in unable.items()],
        "same": [{**_names(variants[label]), "as": first} for label, first in pilot.same.items()],
        "pilot": [
            {"size": list(one.size), "measured": one.measured, "kept": one.kept, "rounds": one.rounds}
            for one in found.rungs
        ],
        "frames": pilot.frames,
        "took_s": pilot.took_s,
    }


def _names(variant: Variant) -> Json:
    return {"label": variant.label, **variant.as_dict()}


def _finalist(one: Finalist, found: Verdict, pilot: Pilot, variant: Variant) -> Json:
    return {
        **_names(variant),
        **figures_of(pilot, one.label, one.seconds),
        "wrong": one.judged.wrong,
        "memory_bytes": one.memory,
        "ratio": one.ratio.ratio,
        "low": one.ratio.low,
        "high": one.ratio.high,
        "told_apart": one.ratio.told_apart,
        "fastest": one.label == found.fastest,
    }


def _eliminated(one: Eliminated, variants: dict[str, Variant]) -> Json:
    return {
        **_names(variants[one.label]),
        "leader": one.leader,
        "ratio": one.ratio,
        "low": one.low,
        "high": one.high,
        "size": list(one.size),
        "rounds": one.rounds,
    }


def _judged(label: str, one: Judged, variants: dict[str, Variant]) -> Json:
    return {**_names(variants[label]), "wrong": one.wrong, "rays": one.rays}


def _work(task: Json, say: Say) -> Json:
    query = Query.from_json(task["query"])
    return answer(query, KeptTwins(query.requests[0].threads), say)


if __name__ == "__main__":
    answer_task(_work)
